"""Section 2: the example telemetry, and the store in which it is placed and from which it is read
back.

"For this example, the signals are synthesized sin waves with periods of 8 and 2 minutes."
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.settings import Settings

START = "2020-01-01T00:00:00Z"
PARTS = {"train": 0.5, "calibration": 0.25, "test": 0.25}
"""Shares of the parts of the telemetry. Detectors trained on telemetry get their thresholds on the
second one.
"""


@dataclasses.dataclass(frozen=True)
class Telemetry:
    """Evenly sampled telemetry.

    Args:
        values: float32 array of shape `(samples,)`.
        interval: Time between two samples in seconds.
        start: Time of the first sample of the whole series, ISO 8601 in UTC.
        name: Its name in the store.
        first: Number of samples before the first one, if this is a part of a series.
    """

    values: np.ndarray
    interval: float
    start: str = START
    name: str = "orbit and rotation"
    first: int = 0

    @property
    def time(self) -> np.ndarray:
        """Seconds since the start of the whole series, float64 of shape `(samples,)`."""
        return self.interval * (self.first + np.arange(len(self.values), dtype=np.float64))

    @property
    def stamps(self) -> pd.DatetimeIndex:
        """Time of each sample in UTC, to the nanosecond."""
        return pd.Timestamp(self.start) + pd.to_timedelta(
            np.round(1e9 * self.time).astype(np.int64), unit="ns"
        )

    def part(self, first: int, stop: int) -> "Telemetry":
        """The samples from `first` up to `stop`."""
        return dataclasses.replace(self, values=self.values[first:stop], first=self.first + first)


class Store(Protocol):
    """Where telemetry is kept: a file, or a database such as the paper's InfluxDB 2."""

    def write(self, telemetry: Telemetry) -> None:
        """Keeps a series."""

    def read(self) -> Telemetry:
        """Returns it."""


class ParquetStore:
    """One Parquet file with the columns `time` and `value`."""

    def __init__(self, path: Path):
        self.path = path

    def write(self, telemetry: Telemetry) -> None:
        """Writes the series with the time of each sample."""
        table = pd.DataFrame({"time": telemetry.stamps, "value": telemetry.values})
        table.attrs = {
            "interval": telemetry.interval,
            "start": telemetry.start,
            "name": telemetry.name,
        }
        table.to_parquet(self.path)

    def read(self) -> Telemetry:
        """Reads the series back."""
        table = pd.read_parquet(self.path)
        return Telemetry(table["value"].to_numpy(np.float32), **table.attrs)


def true_signal(settings: Settings) -> Callable[[np.ndarray], np.ndarray]:
    """The signal without noise: the sum of two sines, as a function of the time in seconds."""

    def signal(time: np.ndarray) -> np.ndarray:
        orbit = settings.orbit_amplitude * np.sin(2 * np.pi * time / settings.orbit_period)
        return orbit + settings.rotation_amplitude * np.sin(
            2 * np.pi * time / settings.rotation_period
        )

    return signal


def make_telemetry(settings: Settings, rng: np.random.Generator) -> Telemetry:
    """The example telemetry: the true signal with white Gaussian noise."""
    clean = true_signal(settings)(settings.interval * np.arange(settings.num_samples))
    noisy = clean + settings.noise_sd * rng.standard_normal(settings.num_samples)
    return Telemetry(noisy.astype(np.float32), settings.interval)


def split(telemetry: Telemetry, window: int, average: int) -> dict[str, Telemetry]:
    """Cuts telemetry into `PARTS`, with a gap of one window between them.

    The moving average of `average` samples shortens the noise of a part.

    Raises:
        InputError: If a part would be too short for ten windows of noise that begin at different
            samples.
    """
    usable = len(telemetry.values) - 2 * window
    parts = {}
    first = 0
    for name, share in PARTS.items():
        stop = first + int(usable * share)
        if stop - first < window + average + 8:
            raise InputError(
                f"Expected at least {4 * (window + average + 8) + 2 * window:,} samples of "
                "telemetry. "
                f"Received: {len(telemetry.values):,}. Use a longer series."
            )
        parts[name] = telemetry.part(first, stop)
        first = stop + window
    return parts


def random_starts(
    num_samples: int, window: int, number: int, rng: np.random.Generator
) -> np.ndarray:
    """First samples of windows "whose beginning and end are offset by a random amount so that all
    sample sizes are the same".
    """
    return rng.integers(0, num_samples - window + 1, number)


def disjoint_starts(num_samples: int, window: int) -> np.ndarray:
    """First samples of all windows of a series that share no sample, in the order of time."""
    return window * np.arange(num_samples // window)


def cut_windows(values: np.ndarray, starts: np.ndarray, window: int) -> np.ndarray:
    """Windows of a series, shape `(windows, window)`."""
    return values[starts[:, None] + np.arange(window)]
