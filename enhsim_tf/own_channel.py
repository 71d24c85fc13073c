"""The paper's pipeline on a channel of one's own: `python -m enhsim_tf.reproduce --telemetry`."""

import dataclasses
import functools
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.coarse.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.common.measures import nrmse
from enhsim_tf.common.stages import Stages
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.settings import Settings
from enhsim_tf.paper.telemetry import START, Store, Telemetry
from enhsim_tf.telemetry.cleaning.clean import Cleaned, Cleaning, clean
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.series import check_values
from enhsim_tf.telemetry.sources import read_source

# with fewer disjoint windows in a part, so many overlapping ones are compared
_FEW = 20
_NUM_OVERLAPPING = 200


class OwnChannel(Pipeline):
    """The paper's pipeline on one channel, in the unit in which its square wave has an amplitude of
    1.

    Its signal without noise is unknown, so errors contain the noise, and claims that need the
    signal are not measured.

    Args:
        settings: All settings.
        stages: Keeps the results.
        store: Where the telemetry is placed and read back from; None for a Parquet file in the
            cache.
        path: A table or an array. It is cleaned, and what was repaired is told.
        column: Its column with the values; None if there is one.
        time: Its column with the times; None: the samples are counted.

    Raises:
        InputError: If the file cannot be read or has a long gap, no square wave fits, or a part is
            too short or without noise.
    """

    truth_name = "telemetry"
    not_measured = ("C3", "C8", "C9")  # they need the signal without noise

    def __init__(
        self,
        settings: Settings,
        stages: Stages,
        store: Store | None,
        path: Path,
        column: str | None,
        time: str | None,
    ):
        super().__init__(settings, stages, store)
        cleaned = _clean(path, column, time)
        for line in cleaned.report.lines():
            stages.tell(line)
        (read,) = cleaned.parts
        wave = SquareWaveSimulator.fit(read.part(0, len(read) // 2))
        offset, scale = level_offset_and_scale(wave)
        values = ((read.values[:, 0] - offset) / scale).astype(np.float32)
        start = (read.start or START).replace("+00:00", "Z")
        self.own = Telemetry(values, read.interval_s, start, printable(path.stem))
        self.simulator = lambda time: (wave(time + read.offset_s) - offset) / scale
        self.truth = lambda time: values[np.rint(time / read.interval_s).astype(int)]
        self.noise_unit = self._noise_unit()

    @property
    def telemetry_settings(self) -> dict[str, Any]:
        """What the telemetry depends on."""
        return {
            "name": self.own.name,
            "checksum": zlib.crc32(self.own.values.tobytes()),
            "interval": self.own.interval,
        }

    @functools.cached_property
    def allowed_nrmse(self) -> float:
        """The error of the coarse simulation: all errors contain the noise of the telemetry."""
        test = self.windows("test")
        return nrmse(test["coarse"], test["truth"])

    def new_telemetry(self) -> Telemetry:
        """The telemetry before it is placed in the store."""
        return self.own

    def _starts(self, num_samples: int, number: int | None, purpose: str) -> np.ndarray:
        if number is None and num_samples < _FEW * self.settings.window:
            return np.unique(
                np.linspace(0, num_samples - self.settings.window, _NUM_OVERLAPPING).astype(int)
            )
        return super()._starts(num_samples, number, purpose)

    def _noise_unit(self) -> np.float32:
        """The unit in which the noise has the standard deviation 0.1, as that of the paper's
        example.
        """
        for name, part in self.parts.items():
            noise = np.std(self.noise_windows(name), dtype=np.float64)
            # 32-bit telemetry resolves no less
            if not noise > 1e-5 * np.std(part.values, dtype=np.float64):
                raise InputError(
                    f"Expected noise around the moving average of {self.own.name}. Received: none "
                    f"in its {name} part. Choose another channel."
                )
        return np.float32(10 * np.std(self.noise_windows("train"), dtype=np.float64))


def _clean(path: Path, column: str | None, time: str | None) -> Cleaned:
    """Reads and cleans the channel; raises an `InputError` if there are several, or if it has
    several parts or is constant.
    """
    cleaning = Cleaning(time_format="s")
    channels = read_source(
        path, None if column is None else [column], NO_TIME if time is None else time, cleaning
    )
    if len(channels) > 1:
        known = ", ".join(list(channels)[:8])
        raise InputError(
            f"Expected one column. Received: {len(channels)} in {path.name} ({known}). Name one "
            "with --column."
        )
    (channel,) = channels.values()
    cleaned = clean(dataclasses.replace(channel, name=f"{channel.name} of {path.name}"), cleaning)
    if len(cleaned.parts) > 1:
        raise InputError(
            f"Expected telemetry without long gaps. Received: {len(cleaned.parts)} parts in "
            f"{path.name}. Cut it to one of them."
        )
    values = check_values(cleaned.longest.values[:, 0], cleaned.report.channel)
    if not np.ptp(values):
        raise InputError(
            f"Expected telemetry that varies. Received: the constant {values[0]:g} in "
            f"{cleaned.report.channel}. Choose another channel."
        )
    return cleaned
