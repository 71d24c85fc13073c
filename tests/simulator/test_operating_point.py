from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.simulator.operating_point import (
    beyond,
    changed_properties,
    find_departure,
    lasting,
    measured,
)


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ([0] * 20 + [1] * 80, 20),
        ([0] * 20 + [1] * 79, None),  # seven windows and nine tenths
        ([1] * 100, 0),
        ([1] + [0] * 19 + [1] * 80, 20),  # an alarm of one sample before
        (
            [1] * 10 + [0] * 20 + [1] * 270,
            30,
        ),  # nine tenths of all are flagged, but not of the eight windows after the alarm
        ([0] * 10 + [1] * 70 + [0] * 20, None),  # it has gone back
        ([0] * 10 + ([1] * 9 + [0]) * 9, 10),  # nine tenths are flagged
    ],
)
def test_where_a_departure_begins_by_hand(flags, expected):
    flags = np.array(flags, bool)
    assert lasting(flags, np.ones(len(flags), bool), window=10) == expected


def test_samples_without_scores_do_not_count():
    flags, scored = np.zeros(200, bool), np.zeros(200, bool)
    flags[120:], scored[50:100], scored[110:] = True, True, True
    assert lasting(flags, scored, window=10) == 120


FORMS = {  # each of mean 0 and standard deviation 1
    "sine": lambda cycle: np.sqrt(2) * np.sin(2 * np.pi * cycle),
    "square": lambda cycle: np.where(cycle % 1 < 0.5, 1.0, -1.0),
    "sawtooth": lambda cycle: np.sqrt(12) * (cycle % 1 - 0.5),
}
OTHER = {"sine": "square", "square": "sawtooth", "sawtooth": "sine"}
CHANNELS = ("volts", "amps", "watts")


def waves(wave, number, noise_sd, seed, **changed):
    """Eight hundred samples of waves of period 40, at other phases, in noise; the last channel is changed."""
    rng, columns = np.random.default_rng(seed), []
    for channel in range(number):
        own = {"form": wave, "level": 5.0, "amplitude": 1.0, "period": 40.0, "delay": 0.0} | (
            changed if channel == number - 1 else {}
        )
        cycle = (np.arange(800) + 100 * seed - 7 * channel - own["delay"]) / own["period"]
        columns.append(
            own["level"]
            + own["amplitude"] * FORMS[own["form"]](cycle)
            + noise_sd * rng.standard_normal(800)
        )
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("noise_sd", [0.0, 0.2])
@pytest.mark.parametrize("form", FORMS)
def test_each_change_alone_is_named_with_its_channel(form, noise_sd, number):
    changes = [
        *({"level": 5.0 + step} for step in (-1.0, 1.0)),
        *({"amplitude": size} for size in (0.5, 0.8, 1.2, 1.5)),
        *({"period": 40.0 * ratio} for ratio in (0.5, 0.8, 1.2, 1.5)),
        {"form": OTHER[form]},
        *([{"amplitude": -1.0}, {"delay": 10.0}] if number > 1 else []),
    ]
    old = measured([waves(form, number, noise_sd, 0)], 400, np.arange(0, 401, 40))
    for change in changes:
        new = measured([waves(form, number, noise_sd, 1, **change)], 400, np.arange(0, 401, 40))
        name = (
            "channel relation"
            if change in ({"amplitude": -1.0}, {"delay": 10.0})
            else next(iter(change)).replace("form", "shape")
        )
        expected = name if number == 1 else f"{name} of watts"
        assert changed_properties(old, new, CHANNELS[:number]) == (expected,), change


def test_a_relation_of_two_channels_names_both_and_many_channels_are_counted():
    old, new = (
        measured([waves("sine", 2, 0.1, seed, amplitude=size)], 400, np.arange(400))
        for seed, size in ((0, 1.0), (1, -1.0))
    )
    assert changed_properties(old, new, ("volts", "amps")) == (
        "channel relation of volts and amps",
    )
    old, new = (
        measured([np.tile(waves("sine", 1, 0.1, 0) + level, 5)], 400, np.arange(400))
        for level in (0.0, 1.0)
    )
    assert changed_properties(old, new, tuple("abcde")) == ("level of 5 channels",)


def test_samples_nearest_to_windows_beyond_the_limits_are_marked():
    series = np.zeros((60, 1))
    series[40:] = 3.0
    low, high = (
        np.full(6, -20.0),
        np.array([2.0, *[20.0] * 5]),
    )  # of the level alone; of one channel, the relation are two more numbers
    np.testing.assert_array_equal(
        np.flatnonzero(beyond(series, low, high, 10)), np.arange(43, 60)
    )  # half of the window 35 to 45 is no more than 1.5


def departed(level, amplitude, scored):
    """Forty nominal periods of 20 samples, then forty with another level and amplitude, in two stretches; what `find_departure` says."""
    wave = np.sin(2 * np.pi * np.arange(800) / 20)
    series = np.concatenate([wave, level + amplitude * wave]).astype(np.float32)[:, None]
    nominal = series[:800]
    simulator = SimpleNamespace(
        window=20,
        nominal=nominal,
        nominal_run=None,
        judged_series=lambda telemetry, run: [telemetry],
        is_run_model=True,
        channels=("volts",),
    )
    scores = np.where(np.arange(1_600) < 800, 0.5, scored)
    return find_departure(
        simulator, lambda moved: moved[:, 0], scores, [(0, series[:1_000]), (1_000, series[1_000:])]
    ), wave


def test_scores_after_a_departure_are_those_of_telemetry_moved_back():
    found, wave = departed(level=3.0, amplitude=2.0, scored=2.0)
    assert (
        780 <= found.begin <= 800
        and found.what == ("level", "amplitude")
        and found.settled == found.begin + 40
    )
    np.testing.assert_allclose(found.scores[: found.begin], 0.5)
    np.testing.assert_allclose(
        found.scores[800:], wave, atol=1e-5
    )  # the score here is the telemetry itself


# windows of nominal telemetry all have the level 0 and the standard deviation .707, of which a tenth is allowed on each side
@pytest.mark.parametrize(
    ("level", "amplitude", "leaves"),
    [
        (0.07, 1.0, False),
        (-0.07, 1.0, False),
        (0.08, 1.0, True),
        (-0.08, 1.0, True),
        (0.0, 1.09, False),
        (0.0, 1.12, True),
        (0.0, 0.88, True),
    ],
)
def test_telemetry_that_is_not_flagged_has_left_beyond_a_tenth_of_its_amplitude(
    level, amplitude, leaves
):
    found, _ = departed(level, amplitude, scored=0.5)
    assert (found is not None) == leaves and (not leaves or 790 <= found.begin <= 810)


@pytest.mark.parametrize(
    ("change", "what"),
    [({"level": 6.0}, "level"), ({"period": 48.0}, "period"), ({"period": 32.0}, "period")],
)
def test_windows_shorter_than_a_period_show_a_departure_that_is_not_flagged(change, what):
    alignment = SimpleNamespace(longest_period=40.0)
    judged = {
        "judged_series": lambda telemetry, run: [telemetry],
        "is_run_model": False,
        "alignment": alignment,
    }
    simulator = SimpleNamespace(
        window=20, nominal=waves("sine", 1, 0.1, 0), nominal_run=None, channels=("volts",), **judged
    )
    series = np.concatenate([waves("sine", 1, 0.1, 1), waves("sine", 1, 0.1, 2, **change)])
    found = find_departure(
        simulator, lambda moved: np.zeros(len(moved)), np.zeros(1_600), [(0, series)]
    )
    assert (
        found.what == (what,) and 740 <= found.begin <= 840
    )  # half a window of two periods on either side


def test_a_simulator_without_nominal_telemetry_names_the_shape():
    simulator, scores = SimpleNamespace(window=20, nominal=None), np.repeat([0.5, 2.0], 400)
    found = find_departure(simulator, None, scores, [(0, np.zeros((800, 1)))])
    assert (found.begin, found.what, found.settled) == (400, ("shape",), None)
    np.testing.assert_array_equal(found.scores, scores)
