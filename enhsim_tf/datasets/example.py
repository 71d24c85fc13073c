"""Two small files of telemetry to try the package with: the current of a heater, made from a
formula.
"""

from pathlib import Path

from enhsim_tf.common.errors import InputError

_FOLDER = Path(__file__).parent / "example_data"


def example(name: str) -> Path:
    """Returns the path of a file of example telemetry, with one sample a second.

    Args:
        name: `nominal.csv`, 25 minutes without a fault, or `new.csv`, ten minutes in which the
            current keeps its value from 400 s to 460 s.

    Raises:
        InputError: If there is no such file.
    """
    names = sorted(path.name for path in _FOLDER.glob("*.csv"))
    if name not in names:
        raise InputError(f"Expected one of the files {', '.join(names)}. Received: {name!r}.")
    return _FOLDER / name
