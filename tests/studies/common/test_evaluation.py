"""The evaluation of arms: the counted quantities, and the same real telemetry for all arms."""

import numpy as np
import pytest

from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import INJECTIONS, SEVERITIES
from enhsim_tf.detection.detectors import LargestStep, PCAResidual
from enhsim_tf.telemetry.windows import mean_over_windows
from studies.common import evaluation
from studies.common.evaluation import evaluate_arm, false_alarm_rates, inject_into_trace, make_trial, score_trace

WINDOW = 300


class Largest:
    """Scores a window by its maximum, so that all rates can be computed by hand."""

    def fit(self, windows):
        return self

    def score(self, windows):
        return np.max(windows, axis=1)


def noise(num_windows, seed, sd=1.0):
    return np.random.default_rng(seed).normal(0, sd, (num_windows, WINDOW)).astype(np.float32)


def trial(seed=0, num_windows=120, **settings):
    trace = np.random.default_rng(9).normal(size=8_000).astype(np.float32)
    return make_trial(noise(num_windows, 1), noise(num_windows, 2), trace, 1.0, seed, num_anomalous=30, **settings)


def test_every_kind_and_severity_is_there_at_the_same_places():
    made = trial()
    assert set(made.anomalous) == {(kind, severity) for kind in INJECTIONS for severity in SEVERITIES}
    chosen = made.nominal[np.linspace(0, 119, 30).astype(int)]
    in_thirds = np.concatenate([chosen[number::3] for number in range(3)])
    changed = {key: windows != in_thirds for key, windows in made.anomalous.items()}
    for kind in ("level_shift", "variance_change", "oscillation"):
        lengths = {1.0: changed[kind, 1.0].sum(axis=1), 8.0: changed[kind, 8.0].sum(axis=1)}
        for severity in (1.0, 8.0):
            for third, duration in enumerate((25, 100, 250)):
                assert (np.abs(lengths[severity][10 * third : 10 * third + 10] - duration) <= duration // 10 + 1).all()
    np.testing.assert_array_equal(changed["level_shift", 1.0], changed["level_shift", 8.0])
    # an oscillation of 20 samples is zero at every tenth sample of the range; everything else it shares with the shift
    assert (changed["level_shift", 1.0] | ~changed["oscillation", 1.0]).all()


def test_same_seed_same_trial_and_another_differs():
    for first, second, same in ((trial(3), trial(3), True), (trial(3), trial(4), False)):
        assert np.array_equal(first.trace, second.trace) is same
        assert np.array_equal(first.anomalous["ramp", 2.0], second.anomalous["ramp", 2.0]) is same


def test_the_trace_holds_two_ranges_of_each_kind():
    made = trial()
    stretches = np.array_split(made.labels, len(INJECTIONS))
    for kind, marks in zip(INJECTIONS, stretches, strict=True):
        begins = np.flatnonzero(np.diff(marks.astype(int), prepend=0) == 1)
        assert len(begins) == (2 if kind != "spike" else 2 * -(-100 // 25))
    original = np.random.default_rng(9).normal(size=8_000).astype(np.float32)
    np.testing.assert_array_equal(made.trace[~made.labels], original[~made.labels])


def test_rates_worked_by_hand():
    made = trial(rate=0.1)
    held_out = noise(99, 5)
    found = evaluate_arm(noise(50, 4), held_out, made, {"largest": lambda seed: Largest()}, seed=0, num_blocks=4)
    threshold = np.sort(held_out.max(axis=1))[89]  # rank ceil(100 * 0.9) of 99
    alarms = made.nominal.max(axis=1) > threshold
    assert [row["alarms"] for row in found["alarms"]] == [int(block.sum()) for block in np.split(alarms, 4)]
    assert [row["windows"] for row in found["alarms"]] == [30] * 4
    assert false_alarm_rates(found["alarms"]) == {"largest": pytest.approx(alarms.mean())}
    (row,) = [row for row in found["recall"] if (row["kind"], row["severity"]) == ("level_shift", 4.0)]
    scores = made.anomalous["level_shift", 4.0].max(axis=1)
    assert row["recall"] == np.mean(scores > threshold)
    assert row["recall_at_real_rate"] == np.mean(scores > metrics.threshold(made.reference.max(axis=1), 0.1))
    assert len(found["recall"]) == len(INJECTIONS) * len(SEVERITIES) and len(found["traces"]) == 1


def test_exchangeable_arms_alarm_at_the_rate_they_were_set_for():
    # 40 draws of 500 windows: the mean of the rates has a standard error below sqrt(0.05 * 0.95 / 500 * 2 / 40) = 0.0022
    rates = []
    for seed in range(40):
        nominal = noise(500, [seed, 1])
        real = evaluation.Trial(nominal, nominal, {("ramp", 1.0): nominal[:5]}, rate=0.05)
        found = evaluate_arm(noise(5, [seed, 2]), noise(500, [seed, 3]), real, {"step": lambda seed: LargestStep()}, seed=0)
        rates.append(false_alarm_rates(found["alarms"])["step"])
    assert abs(np.mean(rates) - 0.05) < 0.008


def test_too_clean_an_arm_alarms_on_everything_and_too_noisy_a_one_on_nothing():
    made = trial()
    rates = {}
    for name, sd in (("clean", 0.5), ("right", 1.0), ("noisy", 2.0)):
        found = evaluate_arm(noise(200, 6, sd), noise(200, 7, sd), made, {"PCA": lambda seed: PCAResidual(5, seed=seed)}, seed=0)
        rates[name] = false_alarm_rates(found["alarms"])["PCA"]
        recalls = [row["recall"] for row in found["recall"] if row["kind"] == "variance_change"]
        assert recalls == sorted(recalls)  # grows with the severity
    assert rates["clean"] == 1.0 and rates["right"] < 0.1 and rates["noisy"] == 0.0


def test_a_score_for_each_sample_is_the_mean_over_its_windows():
    trace = np.random.default_rng(0).normal(size=47).astype(np.float32)
    begins = [0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 37]  # the last window ends with the trace
    found = score_trace(Largest(), trace, window=10, stride=4)
    expected = [np.mean([trace[begin : begin + 10].max() for begin in begins if begin <= place < begin + 10]) for place in range(47)]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_samples_behind_the_last_window_take_its_score():
    scores = mean_over_windows(np.array([1.0, 3.0, 8.0]), np.array([0, 2, 4]), 4, 10)
    assert scores.tolist() == [1, 1, 2, 2, 5.5, 5.5, 8, 8, 8, 8]


def test_a_trace_shorter_than_a_window_is_refused(refused):
    with refused("9 samples"):
        score_trace(Largest(), np.zeros(9, np.float32), window=10, stride=4)


def test_ranges_of_a_trace():
    trace = np.full(10_000, 2.0)
    values, labels = inject_into_trace(trace, "level_shift", 3, 50, 0.1, num_ranges=20, gap=100, rng=np.random.default_rng(0))
    assert values.dtype == np.float32 and labels.dtype == bool and values.shape == labels.shape == (10_000,)
    begins, ends = np.flatnonzero(np.diff(labels, prepend=False, append=False)).reshape(-1, 2).T
    assert (ends - begins == 50).all() and len(begins) == 20
    assert (begins[1:] - ends[:-1]).min() >= 100 and begins[0] >= 100 and ends[-1] <= 9_900
    assert (values[~labels] == 2).all() and np.abs(values[labels] - 2) == pytest.approx(np.full(1_000, 0.3), abs=1e-6)
    assert len(set(np.round(values[begins] - 2, 3))) == 2  # each range draws its side


def test_every_arrangement_of_a_trace_is_as_likely():
    # two ranges of 1 sample, 1 apart at least, among 6 samples: (1, 3), (1, 4), (2, 4)
    rng, counts = np.random.default_rng(0), {}
    for _ in range(3_000):
        places = tuple(np.flatnonzero(inject_into_trace(np.zeros(6), "dropout", 1, 1, 1, 2, 1, rng)[1]).tolist())
        counts[places] = counts.get(places, 0) + 1
    assert set(counts) == {(1, 3), (1, 4), (2, 4)}
    assert list(counts.values()) == pytest.approx([1_000] * 3, abs=5 * np.sqrt(3_000 * 2 / 9))


def test_anomalies_that_do_not_fit_into_a_trace_are_refused(refused):
    for number in (4, 0):
        with refused(f"num_ranges={number}", "100 samples"):
            inject_into_trace(np.zeros(100), "ramp", 1, 20, 0.1, num_ranges=number, gap=6, rng=np.random.default_rng(0))
