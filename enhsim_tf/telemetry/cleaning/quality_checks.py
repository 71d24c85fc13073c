"""Quality checks of a cleaned channel, for its report: quantised, stuck, constant or drifting
values. The values are not changed.
"""

import re
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import counted, option_text
from enhsim_tf.telemetry.cleaning.regular_grid import Part
from enhsim_tf.telemetry.cleaning.report import CleaningLog
from enhsim_tf.telemetry.quantisation import Levels

_NUM_STRETCHES = 10  # consecutive stretches whose level and amplitude are compared
_MAX_LEVELS = 4_096  # a channel with more distinct values does not count as quantised
# a channel with fewer other values has states, none of which is a fill value unless it has usual
# digits
_FEWEST_OTHERS = 10
_FAR = 3  # distance of a fill value that has no usual digits from all others, in their range
_STUCK = 20  # a shorter run of one value, in samples, does not count as stuck


def describe_values(parts: Sequence[Part], read: np.ndarray, log: CleaningLog) -> None:
    """Adds findings about the values of a channel to the cleaning log: of its parts, and as they
    were read, before any was filled in.
    """
    _log_fill_values(read, log)
    values = np.concatenate([part.values for part in parts])
    numbers = np.concatenate([part.source_row for part in parts])
    if np.ptp(values) == 0:
        log.add("constant", (), f"the channel is {values[0]:g} throughout", count=len(values))
        return
    rounded = values.astype(np.float32).astype(np.float64)
    error = float(np.abs(rounded - values).max())
    spread = float(values.std())
    if error > 1e-3 * spread:
        text = (
            f"float32 rounds the values by up to {error:.3g}, while their standard deviation is "
            f"{spread:.3g}: subtract their mean first"
        )
        log.add(
            "resolution", (), text, count=int((rounded != values).sum()), details={"error": error}
        )
    levels = Levels.find(read)
    if levels is not None and levels.count <= _MAX_LEVELS:
        text = (
            f"quantised values, {{count}} levels in steps of {levels.step:.4g}: noise smaller than "
            "a step cannot be learnt"
        )
        log.add("quantised", (), text, count=levels.count, details={"step": levels.step})
    _log_counter(parts, log)
    _log_stuck(values, numbers, log)
    _log_drift(values, log)


def _log_fill_values(read: np.ndarray, log: CleaningLog) -> None:
    """Reports a lowest or highest value that repeats exactly, far outside all others, as loggers
    write where they have no value.
    """
    distinct, counts = np.unique(read, return_counts=True)
    low = 0
    high = len(distinct) - 1
    found = []
    while high - low >= 3:
        spread = distinct[high - 1] - distinct[low + 1]
        places = [
            place
            for place, distance in (
                (low, distinct[low + 1] - distinct[low]),
                (high, distinct[high] - distinct[high - 1]),
            )
            if counts[place] >= 2
            and (
                distance > spread
                if _is_usual_fill(distinct[place])
                else high - low >= _FEWEST_OTHERS and distance > _FAR * spread
            )
        ]
        if not places:
            break
        found += places
        low += low in places
        high -= high in places
    if found:
        written = {place: repr(float(distinct[place])).removesuffix(".0") for place in found}
        said = ", ".join(f"{written[place]} ({counts[place]:,} times)" for place in found)
        advice = option_text({"missing_values": [written[place] for place in found]})
        text = (
            f"far outside all other values, {distinct[low]:g} to {distinct[high]:g}: {said}; if "
            f"this means that there is no value, give {advice}"
        )
        log.add(
            "fill values",
            (),
            text,
            count=int(counts[found].sum()),
            details={"values": distinct[found].tolist()},
        )


def _is_usual_fill(value: float) -> bool:
    """Whether a value has the digits of those that loggers write for a missing one: 999.9, -9999,
    -32768, 1e20.
    """
    return bool(
        re.fullmatch(
            r"-?9{2,}\.?9*|-?6999|-?3276[78]|65535|-?9\.9+e\+\d+|-?1e\+[23]\d", f"{value:.15g}"
        )
    )


def _log_stuck(values: np.ndarray, numbers: np.ndarray, log: CleaningLog) -> None:
    begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1) != 0)
    lengths = np.diff(begins, append=len(values))
    stuck = lengths >= max(_STUCK, 3 * np.quantile(lengths, 0.9))
    longest = int(lengths.max())
    text = f"stretches of one value, the longest for {longest:,} samples: {{count}}"
    log.add("stuck", numbers[begins[stuck]], text, details={"longest": longest})


def _log_counter(parts: Sequence[Part], log: CleaningLog) -> None:
    """Reports values that only rise, and perhaps begin again a few times, as those of a meter."""
    steps = np.concatenate([np.diff(part.values) for part in parts])
    rows = np.concatenate([part.source_row[1:] for part in parts])
    back = np.flatnonzero(steps < 0)
    if len(steps) < 100 or (steps > 0).mean() < 0.3 or len(back) > max(3, 1e-3 * len(steps)):
        return
    begins = f" and begin again ({counted(len(back), 'time')})" if len(back) else ""
    text = f"values only rise{begins}, as those of a counter do: give their differences"
    log.add("counter", rows[back], text, count=len(steps))


def _log_drift(values: np.ndarray, log: CleaningLog) -> None:
    if len(values) < 10 * _NUM_STRETCHES:
        return
    low, middle, high = np.array(
        [
            np.quantile(stretch, (0.05, 0.5, 0.95))
            for stretch in np.array_split(values, _NUM_STRETCHES)
        ]
    ).T
    spans = high - low
    usual = float(np.median(spans))
    moves = np.ptp(middle) > 0.5 * usual
    swells = spans.max() > 1.5 * max(spans.min(), 1e-12)
    if moves or swells:
        text = (
            f"level or amplitude changes: over {_NUM_STRETCHES} consecutive stretches the median "
            f"ranges from {middle.min():.4g} to "
            f"{middle.max():.4g}, and the 5 % to 95 % range from {spans.min():.4g} to "
            f"{spans.max():.4g}"
        )
        log.add(
            "changing level",
            (),
            text,
            count=_NUM_STRETCHES,
            details={"low": low.tolist(), "high": high.tolist()},
        )
