"""Coarse simulators from other tools, by the Functional Mock-up Interface (FMI). Needs the optional
extra `fmi` (FMPy).

A Functional Mock-up Unit (FMU) contains compiled code, which runs in this process. Use only FMUs
that you trust.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import short_reason
from enhsim_tf.telemetry.series import Telemetry, check_columns


class FmuSimulator:
    """A coarse simulator that runs an FMU. A scenario sets parameters of the FMU to other values.

    Args:
        path: The `.fmu` file.
        columns: Names of the variables that are recorded.
        parameters: Values of parameters in nominal operation. Others keep the values of the FMU.
        commands: A recorded run of inputs, whose columns have the names of input variables, on the
            clock of the simulation. The values are held from one sample to the next. None: inputs
            keep their start values.

    Raises:
        InputError: If FMPy is missing, the file is no FMU, or a variable does not exist.

    Example:
    >>> commands = read_recording("commands.csv", ["command"])
    >>> simulator = FmuSimulator("heater.fmu", ["power", "celsius"], commands=commands)
    >>> weak = record(simulator, 10.0 * np.arange(1_000), scenario={"efficiency": 0.5})
    """

    def __init__(
        self,
        path: str | os.PathLike,
        columns: Sequence[str],
        parameters: Mapping[str, float] | None = None,
        commands: Telemetry | None = None,
    ):
        self.path = Path(path)
        self.columns = check_columns(columns)
        self.name = self.path.name
        self.parameters = dict(parameters or {})
        self.commands = commands
        try:
            import fmpy
        except ImportError:
            raise InputError(
                "Expected FMPy for an FMU. Received: no such package. Install it: pip install "
                "'enhsim_tf[fmi]'."
            ) from None
        try:
            description = fmpy.read_model_description(str(path))
        # FMPy raises plain exceptions, and those of zip and XML
        except Exception as error:  # noqa: BLE001
            raise InputError(
                f"Expected an FMU. Received: {self.name}, which cannot be read "
                f"({short_reason(error)[:160]}). Export it again."
            ) from None
        self._variables = {
            variable.name: variable.causality for variable in description.modelVariables
        }
        self._check_names(self.columns, "output")  # any variable can be recorded
        self._check_names(self.parameters, "parameter")
        self._check_names(commands.columns if commands else (), "input")

    def run(
        self,
        time_s: np.ndarray,
        scenario: Mapping[str, float] | None = None,
        rng: np.random.Generator | None = None,
    ) -> np.ndarray:
        """Simulates one run, see `interface.CoarseSimulator.run`; a scenario gives other values of
        parameters by name.
        """
        import fmpy

        if scenario is not None and not isinstance(scenario, Mapping):
            raise InputError(
                "Expected a scenario as a dictionary of parameters. Received: "
                f"{str(scenario)[:80]!r}. Write {{'name': value}}."
            )
        self._check_names(scenario or {}, "parameter")
        time_s = np.asarray(time_s, np.float64)
        step_s = float(np.mean(np.diff(time_s)))
        inputs = None
        if self.commands is not None:
            columns = self.commands.run(time_s).astype(np.float64).T
            inputs = np.rec.fromarrays([time_s, *columns], names=["time", *self.commands.columns])
        try:
            output = fmpy.simulate_fmu(
                str(self.path),
                start_time=time_s[0],
                stop_time=time_s[-1],
                output_interval=step_s,
                start_values=self.parameters | dict(scenario or {}),
                input=inputs,
                output=list(self.columns),
            )
        # FMPy raises plain exceptions for whatever goes wrong in the tool's code
        except Exception as error:  # noqa: BLE001
            raise InputError(
                f"Expected {self.name} to simulate {time_s[0]:g} s to {time_s[-1]:g} s. Received: "
                f"{short_reason(error)[:160]}. Correct the model."
            ) from None
        # an FMU may report events in between
        places = np.searchsorted(output["time"], time_s + 1e-6 * step_s, "right") - 1
        if len(output) < 2 or np.abs(output["time"][places] - time_s).max() > 1e-3 * step_s:
            raise InputError(
                f"Expected results of {self.name} at all {len(time_s)} times. Received: "
                f"{len(output)}. Choose another interval."
            )
        return np.stack([output[name][places] for name in self.columns], axis=1).astype(np.float64)

    def _check_names(self, names: Iterable[str], kind: str) -> None:
        known = [name for name, what in self._variables.items() if kind in ("output", what)]
        for name in names:
            if name not in known:
                raise InputError(
                    f"Expected the name of a variable ({kind}) of {self.name}: "
                    f"{', '.join(known)[:160]}. Received: {name!r}."
                )
