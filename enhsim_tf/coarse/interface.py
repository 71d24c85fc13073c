"""The interface of coarse simulators: objects that simulate named columns at given times (steps 1
and 2 of the pipeline).

Square waves have this interface, and so have recorded runs of a user's simulator (`record`). An
object of any class is a simulator if it has the attribute and the method of `CoarseSimulator`.
"""

import copy
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Clock, Part, Telemetry, check_columns


@runtime_checkable
class CoarseSimulator(Protocol):
    """The interface of a coarse simulator.

    It must apply a scenario or refuse it: one that is ignored would give nominal data under the
    label of a fault. `simulate` checks this.

    Args:
        columns: Names of the outputs, for example `("voltage", "current")`.
    """

    columns: tuple[str, ...]

    def run(
        self, time_s: np.ndarray, scenario: Any = None, rng: np.random.Generator | None = None
    ) -> np.ndarray:
        """Simulates one run, an array of shape `(samples, columns)`.

        Args:
            time_s: Times in seconds at a regular interval, ascending, shape `(samples,)`.
            scenario: What differs from nominal operation, in the form that this simulator
                understands; None is nominal.
            rng: Random number generator for what is random in the scenario.
        """


class FunctionSimulator:
    """A coarse simulator made from a function.

    Args:
        function: Called with the times in seconds, shape `(samples,)`, and with `scenario` and
            `rng` if it has these parameters. It returns an array of shape `(samples,)` or
            `(samples, columns)`.
        columns: Names of the outputs.
        name: Name of the simulator in messages. None uses the name of the function.

    Example:
    >>> def heater(time_s, scenario=None):
    ...     power = 0.5 if scenario == "weak heater" else 1.0
    ...     return power * (np.sin(time_s / 600) > 0)
    >>> coarse = FunctionSimulator(heater, columns=["heater"])
    """

    def __init__(
        self, function: Callable[..., Any], columns: Sequence[str], name: str | None = None
    ):
        self.function = function
        self.columns = check_columns(columns)
        self.name = name or getattr(function, "__name__", type(function).__name__)
        parameters = inspect.signature(function).parameters
        self._takes = {word for word in ("scenario", "rng") if word in parameters}

    def run(
        self, time_s: np.ndarray, scenario: Any = None, rng: np.random.Generator | None = None
    ) -> np.ndarray:
        """Calls the function, see `CoarseSimulator.run`; raises InputError for a scenario if the
        function has no parameter for it.
        """
        if scenario is not None and "scenario" not in self._takes:
            raise InputError(
                f"Expected no scenario for {self.name}, which has no parameter `scenario`. "
                f"Received: {scenario!r}. Add the parameter, or leave it out."
            )
        given = {"scenario": scenario, "rng": rng}
        return self.function(time_s, **{word: given[word] for word in self._takes})


def simulate(
    simulator: CoarseSimulator,
    time_s: np.ndarray,
    scenario: Any = None,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """Runs a simulator, see `CoarseSimulator.run`, and checks what it returns; float32 of shape
    `(samples, columns)`.

    Raises:
        InputError: If the object is no simulator, returns another shape or numbers that are not
            finite, or if the run with a scenario equals the nominal run, unless the scenario's
            attribute `severity` is 0.
    """
    name = name_of(simulator)
    if not isinstance(simulator, CoarseSimulator):
        raise InputError(
            "Expected a simulator with the attribute `columns` and the method `run`. Received: "
            f"{name}. Wrap it in FunctionSimulator."
        )
    columns = check_columns(simulator.columns)
    time_s = np.asarray(time_s, np.float64)
    rng = np.random.default_rng(0) if rng is None else rng
    same_draws = copy.deepcopy(rng)
    values = _checked(simulator.run(time_s, scenario, rng), name, columns, time_s)
    if scenario is None or getattr(scenario, "severity", 1) == 0:
        return values
    nominal = _checked(simulator.run(time_s, None, same_draws), name, columns, time_s)
    if np.array_equal(values, nominal):
        raise InputError(
            f"Expected a scenario that changes the run of {name}. Received: {str(scenario)[:80]}, "
            "with which every value equals the nominal one. "
            "Let the simulator apply it, or leave the scenario out."
        )
    return values


def record(
    simulator: CoarseSimulator,
    time_s: np.ndarray,
    scenario: Any = None,
    rng: np.random.Generator | None = None,
    start: str | None = None,
    labels: Mapping[str, Any] | None = None,
) -> Telemetry:
    """Runs a simulator and returns a recording of its output.

    Args:
        simulator: The simulator.
        time_s: Times in seconds at a regular interval, shape `(samples,)`.
        scenario: What differs from nominal operation, or None.
        rng: Random number generator. None: one with seed 0.
        start: Zero of the time axis as ISO 8601 text, or None.
        labels: Values to carry to every sample, such as `{"scenario": "weak heater", "severity":
            0.5}`; a value is one number or text, or an array with one element per sample.

    Raises:
        InputError: If the times are not regular, or the simulator returns something unusable.
    """
    time_s = np.asarray(time_s, np.float64)
    steps = np.diff(time_s)
    if (
        time_s.ndim != 1
        or len(time_s) < 2
        or not (steps > 0).all()
        or np.ptp(steps) > 1e-3 * steps.mean()
    ):
        raise InputError(
            f"Expected at least two ascending times at a regular interval. Received: {len(time_s)} "
            "times. Give regular times."
        )
    values = simulate(simulator, time_s, scenario, rng)
    carried = {
        name: np.broadcast_to(np.asarray(value), len(time_s))
        for name, value in (labels or {}).items()
    }
    clock = Clock.of(float(steps.mean()), start)
    part = Part(values, float(time_s[0]), carried)
    return Telemetry((part,), tuple(simulator.columns), clock, name_of(simulator))


def _checked(output: Any, name: str, columns: tuple[str, ...], time_s: np.ndarray) -> np.ndarray:
    output = np.asarray(output)
    values = output[:, None] if output.ndim == 1 else output
    if values.shape != (len(time_s), len(columns)) or values.dtype.kind not in "fiub":
        raise InputError(
            f"Expected numbers of shape ({len(time_s)}, {len(columns)}) from {name}, one column "
            f"each for {', '.join(columns)[:80]}. "
            f"Received: {output.dtype} of shape {output.shape}. Correct the simulator."
        )
    values = values.astype(np.float32)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        sample, column = bad[0]
        raise InputError(
            f"Expected finite values from {name}. Received: {values[sample, column]} in "
            f"{columns[column]!r} at {time_s[sample]:g} s. "
            "Correct the simulator or its inputs."
        )
    return values


def name_of(simulator: Any) -> str:
    """Returns the name of a simulator for messages: its attribute `name`, or the name of its
    class.
    """
    return str(getattr(simulator, "name", None) or type(simulator).__name__)
