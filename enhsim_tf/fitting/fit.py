"""Fits an enhanced simulator to nominal telemetry, and measures it on the held-out end (sections
2.2 and 2.3).
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.coarse.interface import CoarseSimulator
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.of_runs import fit_runs
from enhsim_tf.fitting.of_waves import fit_waves
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.fitting.report import Report, make_report
from enhsim_tf.noise.registry import noise_model
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.joining import one_series
from enhsim_tf.telemetry.series import Telemetry, check_values

# beyond them, squares of the noise or of the values leave the range of float32
_LEAST_SPAN = 1e-12
_MOST_SIZE = 1e15


# several threads take longer for arrays of this size, and round differently
@threadpool_limits.wrap(limits=1)
def fit(
    telemetry: Telemetry | Sequence[Telemetry] | Mapping[str, Sequence[Telemetry]],
    coarse: CoarseSimulator | None = None,
    options: FitOptions | None = None,
    progress: Progress = SILENT,
) -> tuple[EnhancedSimulator, Report]:
    """Fits an enhanced simulator to nominal telemetry of one or several channels.

    Args:
        telemetry: Nominal telemetry: a series, the parts between its gaps, the parts of several
            channels by name, or a recording.
        coarse: The coarse simulator: a recorded run of the same time, or an object that is run at
            the times of the telemetry. None: square waves, or a constant level for a channel that
            is not periodic.
        options: Options of the fit. None uses the defaults.
        progress: Reports the progress as lines of text.

    Returns:
        The simulator and the report.

    Raises:
        InputError: If the telemetry is too short, if channels share too little time, or
            if the coarse run does not fit.
    """
    options = FitOptions() if options is None else options
    if not isinstance(options, FitOptions):
        raise InputError(
            f"Expected options as FitOptions. Received: {type(options).__name__}. Write "
            "FitOptions(window=64)."
        )
    recording = one_series(telemetry)
    _check_range(recording)
    if coarse is None:
        fitted = fit_waves(recording, options, progress)
    else:
        fitted = fit_runs(recording, coarse, options, progress)
    progress.step("noise")
    name = options.noise or fitted.noise_name
    noise = noise_model(name).fit(fitted.noise, fitted.clean)
    progress.step("report")
    trained = {
        "telemetry": fitted.learnt.telemetry.name,
        "num_samples": len(fitted.learnt),
        "options": dataclasses.asdict(options),
        "noise": name,
    }
    # what is measured must not know the held-out time
    report = make_report(fitted.simulator(noise, fitted.learnt, {}), fitted, name)
    return fitted.simulator(noise, fitted.nominal, trained), report


def _check_range(recording: Telemetry) -> None:
    for name, values in zip(recording.columns, recording.values.T, strict=True):
        check_values(values, name)
        low = float(np.min(values))
        high = float(np.max(values))
        if not (max(-low, high) <= _MOST_SIZE and (high - low >= _LEAST_SPAN or high == low)):
            raise InputError(
                f"Expected values up to {_MOST_SIZE:g} that span at least {_LEAST_SPAN:g}, or 0. "
                f"Received: {name}, from {low:g} to {high:g}. "
                "Give it in another unit."
            )
