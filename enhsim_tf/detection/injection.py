"""Injects anomalies into a nominal series at given or random places, with labels that mark exactly the changed samples.

The kinds of anomaly are those of `anomalies.INJECTIONS`, and their severity is in units of the standard deviation of the noise. A series may
consist of parts with gaps between them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.anomalies import INJECTIONS, check_kind, step_of

TRIES = 100  # drawn places of an anomaly, before the series is said to have no place where it changes a sample
_NORMAL_MAD = 1.482602218505602  # standard deviation of a normal distribution, in units of its median absolute deviation


@dataclasses.dataclass(frozen=True)
class Anomaly:
    """An anomaly at a place in a series.

    Args:
        kind: Kind of the anomaly, a key of `anomalies.INJECTIONS`.
        severity: Severity in units of the standard deviation of the noise; it may be infinite for `stuck`.
        begin: First sample.
        length: Number of samples.

    Raises:
        InputError: If the kind is unknown or a number is out of range.
    """

    kind: str
    severity: float
    begin: int
    length: int

    def __post_init__(self):
        check_kind(self.kind, self.severity)
        if self.begin < 0 or self.length < 1:
            raise InputError(f"Expected an anomaly of at least one sample, from sample 0 on. Received: {self}.")

    @property
    def end(self) -> int:
        """First sample after the anomaly."""
        return self.begin + self.length


def estimate_noise_sd(parts: Sequence[np.ndarray]) -> float:
    """Estimates the standard deviation of the noise of a smooth signal from its second differences.

    The second difference of white noise with the standard deviation s has the standard deviation s * sqrt(6), which is estimated by the
    median absolute deviation, so that jumps of the signal do not count (Gasser, Sroka and Jennen-Steinmetz 1986, with a robust scale). If
    more than half of the differences are zero, as in telemetry with few levels, their root mean square is used instead. Noise that is
    correlated between neighbouring samples is underestimated.

    Args:
        parts: The series, or the parts between its gaps, each of shape `(samples,)`.

    Returns:
        The standard deviation in the unit of the series. It is 0 if no part has a second difference other than 0.
    """
    differences = np.concatenate([np.zeros(0), *(np.diff(np.asarray(part, np.float64), 2) for part in parts if len(part) > 2)])
    if not len(differences):
        return 0.0
    robust = _NORMAL_MAD * np.median(np.abs(differences))
    return float((robust or np.sqrt(np.mean(differences**2))) / np.sqrt(6))


def inject_anomalies(
    parts: Sequence[np.ndarray],
    given: Sequence[Anomaly],
    drawn: Sequence[tuple[str, float, int]],
    noise_sd: float,
    gap: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, list[Anomaly]]:
    """Injects anomalies into a series. They do not overlap, and none extends over a gap of the series.

    Drawn anomalies are placed one after the other, the longest first, each uniformly among all places that are free. A place where the
    anomaly would change no sample is drawn again: for example, `stuck` changes nothing where the telemetry is constant.

    Args:
        parts: The nominal series, or the parts between its gaps, each of shape `(samples,)`. They are not modified.
        given: Anomalies at given places. Samples are counted over all parts.
        drawn: Kind, severity and length of each anomaly whose place is drawn.
        noise_sd: Standard deviation of the noise, in the unit of the series.
        gap: Least number of samples between a drawn anomaly and any other.
        rng: Random number generator.

    Returns:
        `(values, mask, anomalies)`: the float32 series of all parts, a boolean array that marks exactly the changed samples, both of
        shape `(samples,)`, and the anomalies in the order of time, with `begin` and `length` of the samples that have changed.

    Raises:
        InputError: If anomalies overlap, lie outside a part, do not fit, or change no sample.
    """
    edges = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).tolist()
    bounds = list(zip(edges[:-1], edges[1:], strict=True))
    nominal = np.concatenate([np.asarray(part, np.float32) for part in parts])
    values = nominal.copy()
    taken: list[tuple[int, int]] = []
    found: list[Anomaly] = []

    def put(anomaly: Anomaly) -> bool:
        """Whether an anomaly changes the series; then it is kept."""
        changed = _put(values, nominal, anomaly, bounds, noise_sd, rng)
        if changed is not None:
            taken.append((anomaly.begin, anomaly.end))
            found.append(changed)
        return changed is not None

    for anomaly in sorted(given, key=lambda each: each.begin):
        _check_place(anomaly, bounds, taken)
        if not put(anomaly):
            raise InputError(
                f"Expected an anomaly that changes the telemetry. Received: {_text(anomaly)}, which changes no sample. "
                "Choose another place, a longer one or a higher severity."
            )
    for kind, severity, length in sorted(drawn, key=lambda each: -each[2]):
        if not any(put(Anomaly(kind, severity, draw_begin(bounds, taken, length, gap, rng), length)) for _ in range(TRIES)):
            raise InputError(
                f"Expected a place where the anomaly changes a sample. Received: {kind} at {severity:g} sd over {length} samples, which changes "
                f"none at {TRIES} drawn places. Leave it out, or give it a higher severity or a greater length."
            )
    return values, values != nominal, sorted(found, key=lambda each: each.begin)


def _put(
    values: np.ndarray, nominal: np.ndarray, anomaly: Anomaly, bounds: Sequence[tuple[int, int]], noise_sd: float, rng: np.random.Generator
) -> Anomaly | None:
    """Changes the samples of an anomaly and returns the anomaly as it is, or None if no sample has changed."""
    start, stop = next(each for each in bounds if each[0] <= anomaly.begin < each[1])
    centre = np.array([[np.mean(nominal[start:stop], dtype=np.float64)]])
    piece = np.asarray(nominal[anomaly.begin : anomaly.end], np.float64)[None]
    changed = INJECTIONS[anomaly.kind](piece, anomaly.severity * noise_sd, centre, rng)[0]
    step = step_of(anomaly.kind)
    with np.errstate(over="ignore"):
        values[anomaly.begin : anomaly.end : step] = changed[::step]
    here = values[anomaly.begin : anomaly.end]
    if not np.isfinite(here).all():
        raise InputError(f"Expected anomalies within the range of float32. Received: {_text(anomaly)}. Choose a lower severity.")
    places = np.flatnonzero(here != nominal[anomaly.begin : anomaly.end])
    if not len(places):
        return None
    return dataclasses.replace(anomaly, begin=anomaly.begin + int(places[0]), length=int(places[-1] - places[0]) + 1)


def draw_begin(bounds: Sequence[tuple[int, int]], taken: Sequence[tuple[int, int]], length: int, gap: int, rng: np.random.Generator) -> int:
    """Draws the first sample of an event uniformly from all samples at which it fits.

    Args:
        bounds: First sample and end of each part of the series. An event lies within one part.
        taken: First sample and end of each event that is placed already.
        length: Number of samples of the event.
        gap: Least number of samples between two events.
        rng: Random number generator.

    Raises:
        InputError: If the event fits nowhere.
    """
    ranges = []
    for start, stop in bounds:
        inside = sorted(each for each in taken if start <= each[0] < stop)
        begin = start
        for first, end in [*inside, (stop + gap, stop)]:
            if first - gap - length >= begin:
                ranges.append((begin, first - gap - length + 1))
            begin = end + gap
    counts = np.cumsum([stop - start for start, stop in ranges])
    if not ranges:
        raise InputError(
            f"Expected room for events that do not overlap. Received: {bounds[-1][1]:,} samples, in which {len(taken)} events are placed and "
            f"{length} samples with a gap of {gap} on each side are nowhere free. Ask for fewer or shorter ones."
        )
    place = int(rng.integers(counts[-1]))
    number = int(np.searchsorted(counts, place, side="right"))
    return ranges[number][0] + place - (int(counts[number - 1]) if number else 0)


def _check_place(anomaly: Anomaly, bounds: Sequence[tuple[int, int]], taken: Sequence[tuple[int, int]]) -> None:
    """Checks that an anomaly lies within one part and overlaps no other."""
    if not any(start <= anomaly.begin and anomaly.end <= stop for start, stop in bounds):
        raise InputError(
            f"Expected an anomaly within a part of the telemetry, of {len(bounds)} parts with {bounds[-1][1]:,} samples. "
            f"Received: {_text(anomaly)}. Choose a place that no gap and no end cuts."
        )
    for first, end in taken:
        if anomaly.begin < end and first < anomaly.end:
            raise InputError(
                f"Expected anomalies that do not overlap. Received: {_text(anomaly)}, and another from sample {first} to {end}. Move one."
            )


def _text(anomaly: Anomaly) -> str:
    return f"{anomaly.kind} at {anomaly.severity:g} sd from sample {anomaly.begin} to {anomaly.end}"
