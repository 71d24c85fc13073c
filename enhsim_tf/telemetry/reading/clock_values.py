"""What numbers say that may be a clock: whether they increase, by equal steps, and whether two
columns show the same time.
"""

import numpy as np

from enhsim_tf.telemetry.cleaning.options import UNITS_NS
from enhsim_tf.telemetry.cleaning.times import epoch_unit

FEWEST = 8  # rows below which no step of a column counts as regular
_RATIOS = sorted({one / other for one in UNITS_NS.values() for other in UNITS_NS.values()})


def steps_of(values: np.ndarray) -> np.ndarray:
    """Returns the steps between the numbers that are not missing."""
    return np.diff(values[np.isfinite(values)])


def is_increasing(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout; some may repeat, and a few may come late."""
    steps = steps_of(values)
    return bool(len(steps)) and bool(np.mean(steps >= 0) >= 0.9 and np.mean(steps > 0) >= 0.3)


def may_count(values: np.ndarray) -> bool:
    """Whether time spans never go back, but for a few that come late, or fall in equal steps."""
    steps = steps_of(values)
    return bool(np.any(steps > 0) and np.mean(steps >= 0) >= 0.9) or is_regular(values[::-1])


def is_regular(values: np.ndarray) -> bool:
    """Whether numbers increase nearly throughout, nearly always by one step or a multiple of it."""
    steps = steps_of(values)
    if len(steps) < FEWEST or np.mean(steps > 0) < 0.95:
        return False
    ratios = steps / np.median(steps)
    return bool(np.mean((np.abs(ratios - np.round(ratios)) <= 0.1) & (ratios > 0.5)) >= 0.9)


def epoch_unit_of(values: np.ndarray) -> str | None:
    """Returns the unit in which numbers are times since 1970, s, ms, us or ns, or None."""
    some = values[:: max(1, len(values) // 1_000)]
    known = some[np.isfinite(some)]
    return epoch_unit(float(np.median(np.abs(known)))) if len(known) else None


def is_epoch(values: np.ndarray) -> bool:
    """Whether numbers are times since 1970."""
    return epoch_unit_of(values) is not None


def are_whole(values: np.ndarray, least: float, most: float) -> bool:
    """Whether all values are whole numbers in a range."""
    return bool(((values >= least) & (values <= most) & (values % 1 == 0)).all())


def is_nearly(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two columns are the same but for rounding and their unit."""
    is_alike = (np.isfinite(first) == np.isfinite(second)).all()
    return is_alike and any(_is_small(second - ratio * first, second) for ratio in _RATIOS)


def shows_time(times: np.ndarray, values: np.ndarray) -> bool:
    """Whether a column shows times once more: from another zero, in another unit, rounded, or so
    that it begins again now and then.
    """
    both = np.isfinite(times) & np.isfinite(values)
    times = times[both] - np.min(times[both], initial=np.inf)
    values = values[both] - np.min(values[both], initial=np.inf)
    if len(times) < 3 or np.ptp(values) == 0:
        return False
    steps = np.diff(times)
    own = np.diff(values)
    sizes = np.ptp(values), np.median(np.abs(own))
    spans = np.ptp(times), np.median(np.abs(steps))
    return any(
        np.mean((np.abs(own / ratio - steps) <= 0.05 * steps) & (steps > 0)) > 0.4
        or _is_small(values - ratio * times, values)
        for ratio in _RATIOS
        if any(size / 2 < ratio * span < 2 * size for size, span in zip(sizes, spans, strict=True))
    )


def _is_small(off: np.ndarray, values: np.ndarray) -> bool:
    """Whether values are off by no more than rounding them to whole numbers, or than most of their
    usual step.
    """
    known = values[np.isfinite(values)]
    rounding = (known % 1 == 0).all() and np.ptp(known) >= 3
    return np.nanmax(np.abs(off)) <= max(rounding, 0.6 * np.median(np.abs(np.diff(known))))
