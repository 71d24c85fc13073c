"""The options of `inject`, which are checked before anything slow is imported."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.places import Place, parse_length, parse_place
from enhsim_tf.detection.anomalies import INJECTIONS, check_kind

WITHOUT_SEVERITY = ("another_time", "delay", "lost_coupling")
JOINT_KINDS = (*WITHOUT_SEVERITY, "common_shift")
_MOST = 10_000  # anomalies in a channel


@dataclasses.dataclass(frozen=True)
class InjectOptions:
    """Settings of `inject`.

    Args:
        kinds: Kinds of the anomalies whose places are drawn, of `anomalies.INJECTIONS` or of `JOINT_KINDS`. They are used in turn.
        severity: Least and greatest severity, in units of the standard deviation of the noise. Each anomaly draws its own; those of
            `WITHOUT_SEVERITY` have none.
        length: Least and greatest length: samples, or a time such as `10min`. Each anomaly draws its own.
        number: Number of anomalies whose places are drawn. None: one of each kind.
        at: Anomalies at given places, `KIND[:SEVERITY]@BEGIN/LENGTH`. BEGIN is a sample number or a time. The severity is drawn if it
            is not given.
        noise_sd: Standard deviation of the noise, in the unit of the channel. None: `anomalies.estimate_noise_sd`.
        seed: Random seed. Each channel draws from its own generator, which depends on the seed and the name of the channel.

    Raises:
        InputError: If a kind is unknown, a number is out of range, or options contradict each other.
    """

    kinds: Sequence[str] = ()
    severity: tuple[float, float] = (4.0, 4.0)
    length: tuple[str, str] = ("100", "100")
    number: int | None = None
    at: Sequence[str] = ()
    noise_sd: float | None = None
    seed: int = 0

    @property
    def is_joint(self) -> bool:
        """Whether the anomalies are those of several channels."""
        return bool(set(self.kinds) & set(JOINT_KINDS))

    def __post_init__(self):
        low, high = self.severity
        for kind in self.kinds:
            check_kind(kind, low, (*INJECTIONS, *JOINT_KINDS))
        if not (0 <= low <= high and (high < np.inf or low == high)):
            raise InputError(f"Expected severities from 0 on, the least first. Received: {low:g}:{high:g}.")
        if not self.kinds and not self.at:
            raise InputError("Expected kinds of anomaly or places. Received: neither. Give --kinds, such as all, or --at.")
        if self.number is not None and (not 1 <= self.number <= _MOST or not self.kinds):
            raise InputError(f"Expected 1 to {_MOST:,} anomalies with drawn places, of given kinds. Received: number={self.number}.")
        if self.noise_sd is not None and not 0 < self.noise_sd < np.inf:
            raise InputError(f"Expected a standard deviation of the noise above 0. Received: noise_sd={self.noise_sd}.")
        for text in self.length:
            parse_length(str(text))
        for text in self.at:
            checked_place(text)


def checked_place(text: str) -> Place:
    """Parses a place with a kind of anomaly and its severity, and checks them."""
    place = parse_place(text)
    check_kind(place.kind, 1.0 if place.severity is None else place.severity)
    return place
