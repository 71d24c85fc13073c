"""Faults of the aircraft and their course over a flight."""

import numpy as np

from studies.common import faults as common

UNIT_SAMPLES = 1_200
ONSET = UNIT_SAMPLES // 4
"""Samples of a flight, and the first one of a fault in it."""
SIZES = {
    "left engine": (0.005, 0.02, 0.05, 0.1, 0.3),
    "both engines": (0.02, 0.05, 0.1, 0.2, 0.3),
    "pitot": (1.0, 2.0, 4.0, 7.0, 10.0),
    "elevator": (0.1, 0.2, 0.3, 0.45, 0.6),
    "icing": (0.02, 0.05, 0.1, 0.15, 0.2),
    "fuel leak": (1.0, 2.0, 4.0, 8.0, 12.0),
}
"""For each fault its size at each of `common.SEVERITIES`.

| kind | size | unit | course |
|---|---|---|---|
| left engine | lost share of the throttle's effect, so that N1 and thrust fall | 1 | at once |
| both engines | lost share of the thrust at equal N1, as of worn compressors | 1 | grows to its size at the end of the flight |
| pitot | how much too high the airspeed reads, for the autopilot as well | knots | at once |
| elevator | lost share of the elevator's deflection | 1 | at once |
| icing | lost share of the lift; drag and weight rise in proportion | 1 | grows to its size in five minutes |
| fuel leak | fuel that the left tank loses | pounds a second | at once |
"""
ICE_DRAG = 0.05
ICE_LB = 10_000.0
"""Drag coefficient and weight in pounds that ice adds, for each unit of lost lift."""
_ICING_SAMPLES = 300


class Fault(common.Fault):
    """A fault of the aircraft."""

    sizes = SIZES


ALL = Fault.all()
"""Every fault at every severity."""


def sizes_over_flight(fault: Fault | None) -> dict[str, np.ndarray]:
    """Computes the size of every fault over one flight.

    Args:
        fault: The fault; None for nominal.

    Returns:
        For each key of `SIZES` an array of shape `(UNIT_SAMPLES,)`, which is 0 before `ONSET` and
        for all faults but this one.
    """
    sizes = {kind: np.zeros(UNIT_SAMPLES) for kind in SIZES}
    if fault is not None:
        since = np.arange(1, UNIT_SAMPLES - ONSET + 1)
        growth = {
            "both engines": since / len(since),
            "icing": np.minimum(since / _ICING_SAMPLES, 1.0),
        }
        sizes[fault.kind][ONSET:] = fault.size * growth.get(fault.kind, np.ones(len(since)))
    return sizes
