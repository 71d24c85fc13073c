"""The data of a run: the example in closed form, parts that no window spans, pairs that agree sample by sample."""

import dataclasses

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.reproduce.paper.data import Data, Source, draw, fill_store
from enhsim_tf.reproduce.settings import make_settings
from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.series import Telemetry

WINDOW = 500
SETTINGS = make_settings("smoke", seed=3)


def _truth(time_s):
    return 0.5 * np.sin(2 * np.pi * time_s / 480) + 0.25 * np.sin(2 * np.pi * time_s / 120)


def _coarse(time_s):
    """Square waves by counting half periods, not by their phase."""
    return sum(level * np.where((time_s // (period / 2)) % 2 == 0, 1, -1) for level, period in ((0.5, 480), (0.25, 120)))


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    store = ParquetStore(tmp_path_factory.mktemp("store"))
    fill_store(store, SETTINGS, None)
    return Data(store, SETTINGS, is_paper=True)


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    """The example with sample numbers for values: each window then says where it was cut."""
    store = ParquetStore(tmp_path_factory.mktemp("counted"))
    store.write(Telemetry(np.arange(100_000, dtype=np.float32), name="orbit and rotation"))
    return Data(store, SETTINGS, is_paper=True)


def _real(tmp_path, values, settings=SETTINGS):
    np.save(tmp_path / "channel.npy", values)
    store = ParquetStore(tmp_path / "store")
    fill_store(store, settings, Source(tmp_path / "channel.npy"))
    return Data(store, settings, is_paper=False)


def _pulses(num_samples, seed=0):
    time = np.arange(num_samples)
    return 2 + np.where(time % 97 < 30, 3.0, 0.0) + 0.2 * np.random.default_rng(seed).standard_normal(num_samples)


# -- the paper's example ---------------------------------------------------------------------------------------------------


def test_the_example_is_its_closed_form_and_white_noise(example):
    (channel,) = example.channels
    series, number = channel.telemetry, 120_000
    assert (len(series), series.interval_s, series.values.dtype) == (number, 1.0, np.float32)
    noise = series.values - _truth(np.arange(number))
    assert abs(noise.std() / 0.1 - 1) < 5 / np.sqrt(2 * number)
    assert abs(noise.mean()) < 5 * 0.1 / np.sqrt(number)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 5 * 0.01 / np.sqrt(number)
    kurtosis = np.mean(noise**4) / noise.var() ** 2
    assert abs(kurtosis - 3) < 5 * np.sqrt(24 / number), "Gaussian"


def test_two_series_instead_of_their_sum(tmp_path):
    settings = make_settings("full", 3, telemetry__layout="separate", telemetry__num_samples=30_000)
    store = ParquetStore(tmp_path)
    fill_store(store, settings, None)
    assert store.names() == ["orbit", "rotation"]
    time, noises = np.arange(30_000), []
    for name, size, period in (("orbit", 0.5, 480), ("rotation", 0.25, 120)):
        noises.append(store.read(name).values - size * np.sin(2 * np.pi * time / period))
        assert abs(noises[-1].std() / 0.1 - 1) < 5 / np.sqrt(2 * len(time))
    assert abs(np.corrcoef(noises)[0, 1]) < 5 / np.sqrt(len(time)), "each its own noise"
    data = Data(store, settings, is_paper=True)
    windows = data.windows("train", 10, "x")
    assert windows["coarse"].shape == (10, WINDOW)
    assert set(np.unique(windows["coarse"][:5])) == {-0.5, 0.5} and set(np.unique(windows["coarse"][5:])) == {-0.25, 0.25}


def test_parts_are_in_order_of_time_with_a_window_between(counted):
    (channel,) = counted.channels
    parts = [part.values for part in (channel.train, channel.calibration, channel.test)]
    assert parts[0][0] == 0 and parts[-1][-1] >= 100_000 - 3
    for earlier, later in zip(parts, parts[1:], strict=False):
        assert later[0] - earlier[-1] > WINDOW, "no window touches two parts"
        assert later[0] - earlier[-1] <= WINDOW + 1, "and no sample is wasted"
    usable = 100_000 - 2 * WINDOW
    for part, share in zip(parts, (0.5, 0.25, 0.25), strict=True):
        assert abs(len(part) - share * usable) <= 1


@pytest.mark.parametrize("part", ["train", "calibration", "test"])
@pytest.mark.parametrize("num_windows", [300, None])
def test_windows_agree_with_the_closed_form_sample_by_sample(counted, part, num_windows):
    windows = counted.windows(part, num_windows, "some purpose")
    series, start = getattr(counted.channels[0], part).values, windows.pop("start")
    index = windows["target"].astype(np.float64)
    assert np.array_equal(np.diff(index, axis=1), np.ones((len(index), WINDOW - 1)))
    assert np.array_equal(series[start], index[:, 0])
    assert index[:, 0].min() >= series[0] and index[:, -1].max() <= series[-1], "no window leaves its part"
    if num_windows is None:
        assert len(index) == len(series) // WINDOW and np.diff(index[:, 0]).min() >= WINDOW, "all that share no sample"
    else:
        assert len(index) == num_windows and len(np.unique(index[:, 0])) > 0.9 * num_windows, "random offsets"
    assert all(values.dtype == np.float32 for values in windows.values())
    np.testing.assert_allclose(windows["truth"], _truth(index), atol=1e-6)
    np.testing.assert_array_equal(windows["coarse"], _coarse(index))


def test_offsets_reach_both_ends_of_a_part(tmp_path):
    store = ParquetStore(tmp_path)
    store.write(Telemetry(np.arange(1_000 + 4 * 520, dtype=np.float32), name="orbit and rotation"))
    data = Data(store, SETTINGS, is_paper=True)
    for part in ("calibration", "test"):
        first = getattr(data.channels[0], part).values[0]
        begins = data.windows(part, 500, "ends")["target"][:, 0]
        assert np.array_equal(np.unique(begins), first + np.arange(21))


def test_noise_windows_are_what_the_moving_average_leaves(example):
    values, half = example.channels[0].test.values.astype(np.float64), 12
    total = np.cumsum(np.concatenate([[0], values]))
    noise = values[half:-half] - (total[25:] - total[:-25]) / 25
    for number in (20, None):
        windows = example.noise_windows("test", number, "x")
        begins = [np.argmin(np.abs(noise[: len(noise) - WINDOW + 1] - row[0])) for row in windows]
        np.testing.assert_allclose(windows, [noise[begin : begin + WINDOW] for begin in begins], atol=1e-6)
    assert len(begins) == len(noise) // WINDOW and np.diff(begins).min() >= WINDOW, "all that share no sample"


def test_draws_belong_to_a_seed_and_a_purpose(example):
    first = example.windows("train", 50, "one purpose")["target"]
    example.windows("train", 7, "another")
    example.noise_windows("test", 9, "a third")
    assert np.array_equal(example.windows("train", 50, "one purpose")["target"], first), "draws for one purpose do not move another's"
    assert not np.array_equal(example.windows("train", 50, "another")["target"], first)
    assert draw(SETTINGS, "x").random() == draw(make_settings("full", seed=3), "x").random()
    assert draw(SETTINGS, "x").random() not in (draw(make_settings("smoke", seed=4), "x").random(), draw(SETTINGS, "y").random())


def test_same_seed_same_telemetry_other_seed_other(tmp_path, example):
    for name, seed, same in (("again", 3, True), ("other", 4, False)):
        fill_store(ParquetStore(tmp_path / name), make_settings("smoke", seed=seed), None)
        values = ParquetStore(tmp_path / name).read("orbit and rotation").values
        assert np.array_equal(values, example.channels[0].telemetry.values) == same


# -- degraded modes, where the truth is known ------------------------------------------------------------------------------


def test_nominal_truth_and_coarse_are_the_closed_form_of_the_same_times(example):
    times = example.degraded_times()
    assert times.shape == (60, WINDOW) and np.array_equal(np.diff(times, axis=1), np.ones((60, WINDOW - 1)))
    np.testing.assert_allclose(example.degraded_truth(None, noisy=False), _truth(times), atol=1e-6)
    np.testing.assert_array_equal(example.degraded_coarse(None), _coarse(times))


def test_degraded_truth_by_hand(example):
    times, onset = example.degraded_times(), WINDOW // 4
    nominal = _truth(times)
    lost = nominal.copy()
    lost[:, onset:] *= 0.5  # the amplitude about the middle level, which is 0
    np.testing.assert_allclose(example.degraded_truth(Degraded("gain_loss", 0.5), noisy=False), lost, atol=1e-6)
    drifted = nominal.copy()
    drifted[:, onset:] += 0.5 * 1.5 * np.linspace(0, 1, WINDOW - onset)  # half of the span from -0.75 to 0.75
    np.testing.assert_allclose(example.degraded_truth(Degraded("drift", 0.5), noisy=False), drifted, atol=1e-6)
    slow = times.copy()
    slow[:, onset:] = slow[:, onset, None] + np.arange(WINDOW - onset) / 1.5
    np.testing.assert_allclose(example.degraded_truth(Degraded("period_change", 0.5), noisy=False), _truth(slow), atol=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_noise_is_added_to_the_degraded_truth_and_does_not_move_it(example, mode):
    scenario = Degraded(mode, 0.5)
    clean = example.degraded_truth(scenario, noisy=False)
    noise = example.degraded_truth(scenario, noisy=True) - clean
    assert abs(noise.std() / 0.1 - 1) < 5 / np.sqrt(2 * noise.size)
    assert np.array_equal(clean, example.degraded_truth(scenario, noisy=False))
    assert not np.allclose(clean, example.degraded_truth(None, noisy=False), atol=0.01)


@pytest.mark.parametrize("mode", MODES)
def test_simulator_and_vehicle_degrade_by_the_same_draws(tmp_path, mode):
    settings = make_settings("full", 3, telemetry__layout="separate", telemetry__num_samples=5_000, detectors__num_windows=40)
    fill_store(ParquetStore(tmp_path), settings, None)
    data, scenario = Data(ParquetStore(tmp_path), settings, is_paper=True), Degraded(mode, 0.5)
    truth, coarse = data.degraded_truth(scenario, noisy=False), data.degraded_coarse(scenario)
    # the orbit alone: wherever the sine is clearly above or below its middle, so is the square wave of the same moment
    middle = np.zeros(WINDOW)
    if mode == "drift":
        middle[WINDOW // 4 :] = 0.5 * np.linspace(0, 1, WINDOW - WINDOW // 4)
    clear = np.abs(truth - middle) > 1e-3
    assert clear.mean() > 0.9
    assert np.array_equal(np.sign(truth - middle)[clear], np.sign(coarse - middle)[clear])


# -- a real channel --------------------------------------------------------------------------------------------------------


def test_a_real_channel_is_fitted_on_its_training_part(tmp_path):
    values = _pulses(4_000)
    data = _real(tmp_path, values)
    (channel,) = data.channels
    assert np.array_equal(channel.telemetry.values, values.astype(np.float32))
    assert channel.calibration is None and channel.truth is None
    assert (len(channel.train), len(channel.test)) == (4_000 - 1_200 - WINDOW, 1_200)
    assert channel.test.offset_s == 2_800 and np.array_equal(channel.test.values, channel.telemetry.values[2_800:])
    (wave,) = channel.coarse.waves
    assert abs(wave.period_s / 97 - 1) < 0.005 and abs(wave.duty - 30 / 97) < 0.02
    assert abs(wave.low - 2) < 0.05 and abs(wave.high - 5) < 0.05
    windows = data.windows("test", None)
    assert np.array_equal(windows["truth"], windows["target"]), "nobody knows the noiseless signal"
    assert len(windows["target"]) == 200 and np.array_equal(windows["target"][0], channel.test.values[:WINDOW])
    assert np.array_equal(windows["target"][-1], channel.test.values[-WINDOW:]), "few disjoint windows: overlapping ones, end to end"


def test_a_real_channel_is_seen_in_units_of_its_levels_and_its_noise(tmp_path, example):
    data = _real(tmp_path, _pulses(4_000))
    offset, scale, noise_scale = data.units
    coarse = data.windows("train", 20, "x")["coarse"]
    np.testing.assert_allclose(np.unique((coarse - offset) / scale), [-1, 1], atol=1e-6)
    noise = data.noise_windows("train", 200, "x")
    assert abs((noise / noise_scale).std() - 0.1) < 0.005
    assert example.units == (0, 1, 1), "the paper's example is left as it is"


def test_nothing_of_the_test_part_reaches_the_fit(tmp_path):
    values = _pulses(4_000)
    other = values.copy()
    other[2_800:] = 50 * np.random.default_rng(1).standard_normal(1_200)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    first, second = _real(tmp_path / "a", values), _real(tmp_path / "b", other)
    assert first.channels[0].coarse.get_config() == second.channels[0].coarse.get_config()
    assert first.units == second.units
    for key, windows in first.windows("train", 60, "x").items():
        assert np.array_equal(windows, second.windows("train", 60, "x")[key])
    assert np.array_equal(first.noise_windows("train", 60, "x"), second.noise_windows("train", 60, "x"))
    assert not np.array_equal(first.windows("test", None)["target"], second.windows("test", None)["target"])


@pytest.mark.parametrize("num_samples", [1_100, 1_600, 1_750])
def test_the_shortest_channels_have_windows_in_both_parts(tmp_path, num_samples):
    data = _real(tmp_path, _pulses(num_samples))
    (channel,) = data.channels
    assert channel.train.offset_s + len(channel.train) <= channel.test.offset_s, "the parts share no sample"
    for part in ("train", "test"):
        for number in (12, None):
            assert data.windows(part, number, "x")["target"].shape[1] == WINDOW
            noise = data.noise_windows(part, number, "x")
            assert noise.shape[1] == WINDOW and np.isfinite(noise).all()
            assert len(noise) >= 10, "the two-sample classifier of claims C6 and C7 needs ten of each kind"


def test_a_channel_too_short_for_that_is_refused(tmp_path, refused):
    with refused("1000"):
        _real(tmp_path, _pulses(1_000))


def test_settings_of_the_coarse_source_reach_it(tmp_path):
    settings = dataclasses.replace(SETTINGS, enhancer=dataclasses.replace(SETTINGS.enhancer, num_levels=6))
    data = _real(tmp_path, _pulses(4_000), settings)
    assert len(np.unique(data.windows("train", 20, "x")["coarse"])) == 6
    fill_store(store := ParquetStore(tmp_path / "example"), settings, None)
    assert len(np.unique(Data(store, settings, is_paper=True).windows("train", 20, "x")["coarse"])) > 6
