"""Fits simulators to many channels in parallel worker processes.

Each channel gets a folder of its own, for example `MODEL_DIR/volts/`. It contains the files of `EnhancedSimulator.save`,
`report.json` and `report.png`. With a recorded run of a coarse simulator, each channel gets a run model instead.
"""

import contextlib
import dataclasses
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_folder, write_json
from enhsim_tf.common.console import SILENT, Progress, tell
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.common.parallel import engines
from enhsim_tf.common.parallel.local import ProcessesDiedError, num_cpus
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.model_folder import folder_of, refuse_foreign
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhanced_simulator.saving import MANIFEST
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

THREADS = 2  # per channel; fixed, because the rounding of sums depends on the number of threads and must not depend on the workers


@dataclasses.dataclass(frozen=True)
class CoarseRun:
    """Where the recorded run of a coarse simulator is.

    Args:
        source: A source of telemetry, see `sources.read_source`.
        columns: Names of the columns that are inputs; None: all numeric columns.
        time: Name of the time column; None: it is detected.
        start: Time of its zero in UTC, if its times count from zero; None: its times are those of the telemetry.
    """

    source: str
    columns: Sequence[str] | None = None
    time: str | None = None
    start: str | None = None


@dataclasses.dataclass(frozen=True)
class Job:
    """One channel to fit.

    Args:
        channel: Name of the channel.
        series: Raw values, as returned by `sources.read_source`.
        folder: Output folder; an absolute path, because a worker may have another working directory.
        options: Settings of the fit.
        cleaning: Settings of the cleaning.
        verbose: Whether to show progress bars.
        speaks: Whether to print lines of progress that begin with the channel's name.
        run: The recorded run of a coarse simulator, for a run model; None for a simulator of square waves.
        commands: Commands of the samples, shape `(samples, commands)`, or None.
    """

    channel: str
    series: "pd.Series"
    folder: Path
    options: FitOptions | RunOptions
    cleaning: Cleaning
    verbose: bool = False
    speaks: bool = False
    run: CoarseRun | None = None
    commands: "np.ndarray | None" = None


def fit_channels(
    series: Mapping[str, "pd.Series"],
    out: str | os.PathLike,
    options: FitOptions | RunOptions,
    cleaning: Cleaning,
    workers: int | None,
    tell: Callable[[str], None],
    verbose: bool = False,
    engine: str = "local",
    speaks: bool = False,
    run: CoarseRun | None = None,
    commands: "np.ndarray | None" = None,
) -> dict[str, str]:
    """Fits a simulator to each channel, saves it together with its report, and prints the report.

    Args:
        series: Raw values of each channel, by the channel's name.
        out: Output folder for all models.
        options: Settings of the fit.
        cleaning: Settings of the cleaning.
        workers: Number of channels that are fitted at the same time, each in its own process. None uses one worker per CPU. The
            number of workers does not change the results. 0 fits all channels in this process, with its own number of threads.
        tell: Function that is called with each line of output.
        verbose: Whether to show progress bars; they are shown only when channels are fitted one at a time.
        engine: How worker processes are run: `local` or `ray`. The engine does not change the results.
        speaks: Whether each local worker prints a line of progress about every fifteen seconds.
        run: The recorded run of a coarse simulator, for run models; None for simulators of square waves.
        commands: Commands of the samples, shape `(samples, commands)`, see `fitting.fit_channel`; None if there are none.

    Returns:
        A dictionary from the name of each channel that could not be fitted to the reason.

    Raises:
        InputError: Before any fit, if a channel's name cannot be used for a folder or an output folder contains something other
            than a saved simulator. Also if the engine is not available or a simulator cannot be written.
    """
    out = make_folder(out)
    if (out / MANIFEST).is_file():
        raise InputError(
            f"Expected a folder for models. Received: {out}, which is a model itself. Give another --out, or its parent folder."
        )
    verbose = verbose and engine == "local" and min(num_cpus() if workers is None else workers, len(series)) <= 1
    here = Path(os.path.abspath(out))
    jobs = [
        Job(name, each, folder_of(here, name), options, cleaning, verbose, speaks and engine == "local", run, commands)
        for name, each in series.items()
    ]
    for job in jobs:
        refuse_foreign(job.folder)
    remove_leftovers(out)
    failed: dict[str, str] = {}

    def note(outcome: Outcome) -> None:
        if outcome.failure is None:
            tell("\n".join([*outcome.lines, f"simulator, report.json and report.png in {folder_of(out, outcome.channel)}/"]))
        else:
            failed[outcome.channel] = outcome.failure

    try:
        if workers == 0:
            for job in jobs:
                note(fit_or_say(job))
        else:
            _fit_in_processes(jobs, engine, workers, note)
    finally:
        remove_leftovers(out)  # temporary files of workers that were killed
    return {name: failed[name] for name in series if name in failed}


def _fit_in_processes(jobs: Sequence[Job], engine: str, workers: int | None, note: Callable[["Outcome"], None]) -> None:
    """Fits the channels with an engine. A channel whose worker dies repeatedly is reported and does not stop the others."""
    waiting = {job.channel: job for job in jobs}

    def fit(some: Sequence[Job], workers: int | None) -> None:
        with contextlib.closing(engines.run(engine, fit_or_say, some, workers, THREADS)) as running:
            for outcome in running:
                note(outcome)
                del waiting[outcome.channel]

    while waiting:
        try:
            fit(list(waiting.values()), workers)
        except ProcessesDiedError as died:
            suspects = [job for job in died.items if job.channel in waiting]
            if not suspects:
                raise
            for job in suspects:  # one at a time, to find the channel that kills its worker, and to give it all the memory
                try:
                    fit([job], 1)
                except ProcessesDiedError:
                    reason = (
                        "Expected a worker process to fit this channel. Received: all of them were killed, perhaps for lack of memory. "
                        "Give less telemetry."
                    )
                    note(Outcome(job.channel, failure=reason))
                    del waiting[job.channel]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The result of fitting one channel.

    Args:
        channel: Name of the channel.
        lines: Lines of its reports, if it was fitted.
        failure: Reason why it could not be fitted, or None.
    """

    channel: str
    lines: Sequence[str] = ()
    failure: str | None = None


def fit_or_say(job: Job) -> Outcome:
    """Fits a channel in a worker process. Errors that concern only this channel are returned, not raised.

    Args:
        job: The channel.

    Returns:
        The lines of its reports, or the reason why it could not be fitted.

    Raises:
        InputError: If the machine lacks disk space or memory, which affects the other channels too.
    """
    try:
        return Outcome(job.channel, fit_job(job))
    except InputError as error:
        return Outcome(job.channel, failure=str(error))
    except (OSError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or "not enough memory"
        raise InputError(
            f"Expected enough memory and disk space for {printable(job.channel)}. Received: {reason}. Finished channels are kept; free some space."
        ) from error
    except Exception as error:  # noqa: BLE001  a defect that one channel meets must not lose the others
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = " ".join(str(error).split())[:200]
        place = f"{Path(where.filename).name}, line {where.lineno}"
        return Outcome(
            job.channel, failure=f"Expected a fit. Received: {type(error).__name__}: {reason}, in {place}. Please report this defect."
        )


def fit_job(job: Job) -> list[str]:
    """Cleans, fits and saves one channel. Nothing is written if a step fails.

    Args:
        job: The channel.

    Returns:
        The lines of its reports.

    Raises:
        InputError: If no simulator can be fitted to the channel.
    """
    progress = Progress(_tell_if_heard, f"{printable(job.channel)}: ") if job.speaks else SILENT
    cleaned = clean(job.series, job.cleaning)
    parts = [dataclasses.replace(part, name=job.channel) for part in cleaned.parts]
    verbose = "auto" if job.verbose else 0
    if job.run is None:
        from enhsim_tf.enhanced_simulator.fitting import fit_channel
        from enhsim_tf.enhanced_simulator.report import ChannelReport
        from enhsim_tf.enhanced_simulator.report_figure import channel_figure
        from enhsim_tf.enhanced_simulator.runs.figure import run_figure

        simulator, report = fit_channel(parts, job.options, verbose, progress, job.commands)
        figure = channel_figure(report) if isinstance(report, ChannelReport) else run_figure(report)
    else:
        from enhsim_tf.coarse_simulator.recording_files import read_recording
        from enhsim_tf.enhanced_simulator.runs.figure import run_figure
        from enhsim_tf.enhanced_simulator.runs.fitting import fit_run_model

        cleaning, interval_s = job.cleaning.of_run(min_part=2), parts[0].interval_s if parts[0].has_time else None
        run = read_recording(job.run.source, job.run.columns, job.run.time, cleaning, interval_s, job.run.start)
        simulator, report = fit_run_model(parts, run, job.options)
        figure = run_figure(report)
    refuse_foreign(job.folder)  # checked again, because the fit took minutes
    with replace_folder(job.folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", {"realism": report.to_dict(), "cleaning": cleaned.report.to_dict()})
        figure.savefig(temporary / "report.png", dpi=200, format="png")
    notes = [f"{printable(job.channel)}: {note}" for note in simulator.trained.get("notes", ())]
    return [*cleaned.report.lines(), *notes, *report.lines()]


def _tell_if_heard(line: str) -> None:
    """Prints a line. A reader that closes the pipe does not stop the fit."""
    try:
        tell(line)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  Python flushes it at exit
