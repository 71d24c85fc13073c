"""Arrays that several figures share: windows of a part, their noise, the time axis, and the unit of the values."""

import numpy as np

from enhsim_tf.enhancer.training_pairs import paired_windows
from enhsim_tf.noise.extraction import extract_noise
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.telemetry.series import Telemetry


def spread_windows(experiment: Experiment, part: str, num_windows: int, purpose: str) -> Arrays:
    """Windows of the first channel, spread over a part: one at a random offset of each equal share of it."""
    channel, window = experiment.data.channels[0], experiment.data.window
    series: Telemetry = getattr(channel, part)
    shares = (np.arange(num_windows) + experiment.data.draw(purpose).random(num_windows)) / num_windows
    offsets = (shares * (len(series) - window + 1)).astype(np.int64)
    coarse, target = paired_windows(series, channel.coarse, offsets, window)
    times = series.time_s[offsets[:, None] + np.arange(window)]
    truth = target if channel.truth is None else channel.truth(times).astype(np.float32)
    return {"coarse": coarse, "target": target, "truth": truth, "offset": offsets}


def window_noise(experiment: Experiment, offset: int, part: str = "test") -> tuple[np.ndarray, np.ndarray]:
    """Noise and moving average of one window of a part; NaN where the part's edge leaves no full average."""
    series, window, width = getattr(experiment.data.channels[0], part), experiment.data.window, experiment.settings.noise.moving_average
    half = width // 2
    noise, average = (np.pad(values, half, constant_values=np.nan) for values in extract_noise(series.values, width))
    return noise[offset : offset + window], average[offset : offset + window]


def time_axis(experiment: Experiment, num_samples: int | None = None) -> Arrays:
    """The time axis of a window or a longer stretch, from 0, in a unit that suits its length, and the values' unit."""
    telemetry = experiment.data.channels[0].telemetry
    time, unit, size = telemetry.interval_s * np.arange(num_samples or experiment.data.window), telemetry.time_unit, 1
    if telemetry.has_time:
        units = {"s": 1, "min": 60, "h": 3_600, "d": 86_400}
        unit, size = next((item for item in units.items() if time[-1] < 300 * item[1]), ("d", 86_400))
    return {"time": time / size, "time_unit": np.array(unit), "unit": value_unit(experiment, telemetry)}


def value_unit(experiment: Experiment, series: Telemetry) -> np.ndarray:
    """The unit of the values as text; most files do not give it."""
    unit = series.unit
    return np.array(unit if unit != "1" else "dimensionless" if experiment.is_paper else "as recorded")


def draw_seed(rng: np.random.Generator) -> int:
    """A seed for a generator that takes a number."""
    return int(rng.integers(2**31))
