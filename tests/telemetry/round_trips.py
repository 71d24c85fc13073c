"""Series that the store must restore bit for bit."""

import numpy as np

from enhsim_tf.telemetry.series import Telemetry

ROUND_TRIPS = {
    "counted": {},
    "tenths": {"interval_s": 0.1, "name": "attitude", "unit": "deg"},
    "thirds": {"interval_s": 1 / 3, "offset_s": 12.7, "start": "2020-03-01T23:59:00.250000+00:00"},
    "hours, before the clock's zero": {"interval_s": 3_600.0, "offset_s": -7_200.0, "start": "2020-02-28T00:00:00+00:00", "unit": "µm"},
    "years after the clock's zero": {"interval_s": 0.1, "offset_s": 1e8 + 0.1, "start": "2020-03-01"},
    "nanoseconds": {"interval_s": 1e-9, "start": "2020-03-01T00:00:00.123456789"},
    "long ago": {"interval_s": 3_600.0, "start": "1700-01-01"},
    "Zulu": {"interval_s": 0.5, "start": "2020-03-01T00:00:00Z"},
    "another zone": {"interval_s": 0.5, "start": "2020-03-01T00:00:00+02:00"},
}
BEYOND = [{"start": "1500-01-01"}, {"start": "2261-12-31", "interval_s": 1e6}, {"offset_s": 1e12}, {"start": "-1"}, {"start": "soon"}]


def same(first: Telemetry, second: Telemetry) -> bool:
    """Whether two series and their metadata are equal, bit for bit."""
    about = ("interval_s", "offset_s", "start", "name", "unit")
    found = [(part.values.dtype, part.values.tobytes(), *(getattr(part, key) for key in about)) for part in (first, second)]
    return found[0] == found[1]


def wheel(number: int = 1_000, seed: int = 0, **about) -> Telemetry:
    """White noise named "wheel", or with other metadata."""
    return Telemetry(np.random.default_rng(seed).normal(size=number).astype(np.float32), **{"name": "wheel"} | about)
