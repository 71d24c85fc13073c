"""Anomalies of several channels: three that leave the values of every channel as usual and change how channels move together, and one fault
that acts on all of them.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.label_columns import label_samples
from enhsim_tf.datasets.places import draw_between, length_limits
from enhsim_tf.detection.anomalies import draw_begin, estimate_noise_sd

if TYPE_CHECKING:
    import pandas as pd

JOINT_KINDS = {
    "another_time": "one channel is that of another time",
    "delay": "one channel is late by a quarter of the anomaly",
    "lost_coupling": "the part of one channel that follows the others is that of another time",
    "common_shift": "all channels are shifted by the severity, in standard deviations of the noise of each",
}


def inject_joint(
    telemetry: Recording,
    kinds: Sequence[str],
    number: int | None,
    severity: tuple[float, float],
    lengths: Sequence[str],
    gap: int | None,
    seed: int,
) -> "pd.DataFrame":
    """Injects anomalies into nominal telemetry of several channels, at drawn places.

    Args:
        telemetry: Nominal telemetry.
        kinds: Kinds, keys of `JOINT_KINDS`; they are used in turn.
        number: Number of anomalies. None: one of each kind.
        severity: Least and greatest severity of `common_shift`.
        lengths: Least and greatest length, in the form of `labelled_windows.parse_length`.
        gap: Least number of samples between two anomalies. None: the greatest length.
        seed: Random seed.

    Returns:
        A data frame with one row per sample: the channels, `label_columns.LABELS` and `mask NAME` for each channel. Samples that are not marked
        keep their values. `frame.attrs["anomalies"]` has kind, severity, begin, end and channel of each.

    Raises:
        InputError: If there is a single channel, a kind is unknown, or the anomalies do not fit.
    """
    import pandas as pd

    from enhsim_tf.simulator.joint import telemetry_of
    from enhsim_tf.telemetry.pandas_series import to_series

    if len(telemetry.columns) < 2:
        raise InputError(f"Expected several channels for {', '.join(kinds)}. Received: {telemetry.name} alone. Give more columns.")
    if set(kinds) - set(JOINT_KINDS):
        raise InputError(f"Expected kinds among {', '.join(JOINT_KINDS)}. Received: {', '.join(kinds)}. Inject other kinds on their own.")
    rng, (shortest, longest) = np.random.default_rng([seed, 61]), length_limits(lengths, telemetry.interval_s)
    values = np.concatenate([part.values for part in telemetry.parts]).astype(np.float32)
    edges = np.cumsum([0, *map(len, telemetry.parts)]).tolist()
    bounds, nominal = list(zip(edges[:-1], edges[1:], strict=True)), values.copy()
    noise_sd = [estimate_noise_sd([part.values[:, channel] for part in telemetry.parts]) for channel in range(values.shape[1])]
    drawn = [(kinds[each % len(kinds)], int(rng.integers(shortest, longest + 1))) for each in range(number or len(kinds))]
    taken: list[tuple[int, int]] = []
    found = []
    for kind, length in sorted(drawn, key=lambda each: -each[1]):
        begin = draw_begin(bounds, taken, length, longest if gap is None else gap, rng)
        degree = draw_between(severity, rng) if kind == "common_shift" else 1.0
        channel = int(rng.integers(values.shape[1]))
        _change(values, nominal, kind, begin, length, channel, bounds, [degree * each for each in noise_sd], rng)
        taken.append((begin, begin + length))
        found.append((kind, degree, begin, begin + length, "all" if kind == "common_shift" else telemetry.columns[channel]))
    found.sort(key=lambda each: each[2])
    mask = values != nominal
    index = pd.concat([to_series(part) for part in telemetry_of(telemetry)]).index
    columns = {name: values[:, channel] for channel, name in enumerate(telemetry.columns)}
    own = {f"mask {name}": mask[:, channel] for channel, name in enumerate(telemetry.columns)}
    frame = pd.DataFrame({**columns, **label_samples(mask.any(axis=1), [each[:4] for each in found]), **own}, index=index)
    frame.attrs["anomalies"] = found
    return frame


def _change(
    values: np.ndarray,
    nominal: np.ndarray,
    kind: str,
    begin: int,
    length: int,
    channel: int,
    bounds: Sequence[tuple[int, int]],
    shifts: Sequence[float],
    rng: np.random.Generator,
) -> None:
    here = slice(begin, begin + length)
    if kind == "common_shift":
        values[here] += np.asarray(shifts, np.float32)
        return
    if kind == "delay":
        start = next(low for low, high in bounds if low <= begin < high)
        values[here, channel] = nominal[np.maximum(np.arange(begin, begin + length) - max(1, length // 4), start), channel]
        return
    first = draw_begin(bounds, [(begin, begin + length)], length, 0, rng)
    away = slice(first, first + length)
    if kind == "another_time":
        values[here, channel] = nominal[away, channel]
        return
    others = np.delete(nominal, channel, axis=1).astype(np.float64)
    centred = others - others.mean(axis=0)
    weights, *_ = np.linalg.lstsq(centred, nominal[:, channel] - nominal[:, channel].mean(dtype=np.float64), rcond=None)
    follows = centred @ weights
    values[here, channel] = (nominal[here, channel] - follows[here] + follows[away]).astype(np.float32)
