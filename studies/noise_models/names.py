"""Names of the study of noise models: in its tables, and of the models that `--rungs` chooses."""

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.rung_names import BY_OPTION
from studies.common.command import Option

RUNG_NAMES = tuple(BY_OPTION.values())
REAL = "real"
"""The arm of real windows, with which every rung is compared."""
PRESENT = "present"
"""The present rule of the choice."""


def rungs_option() -> Option:
    """The option `--rungs`: which noise models a study tries."""
    return Option("--rungs", {"metavar": "A,B", "help": f"only these noise models: {', '.join(RUNG_NAMES)}"})


def chosen_rungs(given: str | None, default: tuple[str, ...]) -> tuple[str, ...]:
    """Reads `--rungs`, in the order of the noise models.

    Raises:
        InputError: If a name is unknown.
    """
    if given is None:
        return default
    names = [name.strip() for name in given.split(",")]
    unknown = [name for name in names if name not in RUNG_NAMES]
    if unknown:
        raise InputError(f"Expected --rungs of {', '.join(RUNG_NAMES)}. Received: {unknown[0]!r}. Name one of these.")
    return tuple(name for name in RUNG_NAMES if name in names)
