"""Options of `inject`. Nothing slow is imported."""

import dataclasses
import math
from collections.abc import Sequence

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.options import check_options, option

WITHOUT_SEVERITY = ("another_time", "delay", "lost_coupling")
JOINT_KINDS = (*WITHOUT_SEVERITY, "common_shift")
MOST_EVENTS = 10_000  # at drawn places


def split_limits(text: str) -> tuple[str, str]:
    """Splits `least:greatest`; one value stands for both."""
    least, colon, greatest = text.partition(":")
    if not least or (colon and not greatest) or ":" in greatest:
        raise InputError(f"Expected one value, or least:greatest. Received: {text!r}.")
    return least, greatest or least


def _split_severities(text: str) -> tuple[float, float]:
    least, greatest = split_limits(text)
    try:
        return float(least), float(greatest)
    except ValueError:
        raise InputError(
            f"Expected a severity such as 4 or 2:8. Received: --severity {text}."
        ) from None


def _split_kinds(text: str) -> tuple[str, ...]:
    if text == "all":
        from enhsim_tf.datasets.anomalies import INJECTIONS  # imports NumPy

        return tuple(INJECTIONS)
    return tuple(filter(None, text.split(",")))


@dataclasses.dataclass(frozen=True)
class InjectOptions:
    """Options of `inject`, as those of the command: each field says what it is.

    Kinds are those of `anomalies.INJECTIONS` and `JOINT_KINDS`. Severities and lengths are the
    least and the greatest, between which each anomaly draws its own; those of `WITHOUT_SEVERITY`
    have no severity. A channel on its own draws from a generator that depends on the seed and the
    name of the channel.

    Raises:
        InputError: If a kind is unknown, a number is out of range, or options contradict each
            other.
    """

    kinds: Sequence[str] = option(
        (),
        "kinds of anomaly at random places, or all; they are used in turn",
        kind=str,
        metavar="KIND,...",
        parse=_split_kinds,
    )
    severity: tuple[float, float] = option(
        (4.0, 4.0),
        "severity in standard deviations of the noise, or a range (default: 4)",
        kind=str,
        metavar="SD[:SD]",
        parse=_split_severities,
    )
    length: tuple[str, str] = option(
        ("100", "100"),
        "length at random places: samples, a time such as 10min, or a range (default: 100)",
        kind=str,
        metavar="N[:N]",
        parse=split_limits,
    )
    number: int | None = option(
        None,
        "number of events at random places, of the kinds or scenarios in turn (default of kinds: "
        "one of each)",
        least=1,
        most=MOST_EVENTS,
    )
    at: Sequence[str] = option(
        (),
        "an event at a given sample or time, such as stuck:1@5000/200 or "
        "stuck:0.5@2024-01-05T12:00/2h",
        kind=str,
        metavar="KIND[:SEVERITY]@BEGIN/LENGTH",
        repeated=True,
    )
    noise_sd: float | None = option(
        None,
        "standard deviation of the noise (default: estimated from second differences)",
        kind=float,
        metavar="SD",
    )
    seed: int = option(0, "random seed", least=0, most=2**31 - 1)

    @property
    def is_joint(self) -> bool:
        """Whether the anomalies are those of several channels."""
        return bool(set(self.kinds) & set(JOINT_KINDS))

    def __post_init__(self):
        from enhsim_tf.datasets.anomalies import INJECTIONS, check_kind
        from enhsim_tf.datasets.places import checked_place, parse_length

        check_options(self)
        low, high = self.severity
        for kind in self.kinds:
            check_kind(kind, low, (*INJECTIONS, *JOINT_KINDS))
        if not (0 <= low <= high and (high < math.inf or low == high)):
            raise InputError(
                f"Expected severities from 0 on, the least first. Received: {low:g}:{high:g}."
            )
        if not self.kinds and (not self.at or self.number is not None):
            raise InputError(
                "Expected kinds of anomaly, or places and no number. Received: no kinds. Give "
                "--kinds, such as all, or --at."
            )
        if self.noise_sd is not None and not 0 < self.noise_sd < math.inf:
            raise InputError(
                "Expected a standard deviation of the noise above 0. Received: "
                f"noise_sd={self.noise_sd}."
            )
        for text in self.length:
            parse_length(str(text))
        for text in self.at:
            checked_place(text)
