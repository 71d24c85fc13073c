"""Faults of a system that a study simulates: a kind, and one of five severities."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar, Self

SEVERITIES = (0.2, 0.4, 0.6, 0.8, 1.0)


@dataclasses.dataclass(frozen=True)
class Fault:
    """A fault. A system gives the class its `sizes`.

    Args:
        kind: A key of `sizes`.
        severity: One of `SEVERITIES`.
    """

    sizes: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """For each kind its size at each of `SEVERITIES`."""
    kind: str
    severity: float

    @property
    def size(self) -> float:
        """Size of the fault, in the unit of `sizes`."""
        return self.sizes[self.kind][SEVERITIES.index(self.severity)]

    @classmethod
    def all(cls) -> tuple[Self, ...]:
        """Every kind at every severity."""
        return tuple(cls(kind, severity) for kind in cls.sizes for severity in SEVERITIES)
