"""Many channels at once: a folder of fitted simulators, one folder a channel, fitted by the processes of an engine.

MODEL_DIR/volts/        what `EnhancedSimulator.save` writes, and
MODEL_DIR/volts/report.json, report.png
"""

import contextlib
import dataclasses
import os
import sys
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
from enhsim_tf.enhanced_simulator.saving import MANIFEST
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean

if TYPE_CHECKING:
    import pandas as pd

THREADS = 2  # for each channel: how sums are rounded depends on their number, so that must not depend on the workers


@dataclasses.dataclass(frozen=True)
class Job:
    """One channel to be fitted.

    Args:
        channel: Its name.
        series: Its raw values, as `sources.read_source` reads them.
        folder: Where its simulator goes; absolute, for another process may stand elsewhere.
        options: How it is fitted.
        cleaning: What to do with dirty values.
        verbose: Whether to show progress bars.
        speaks: Whether to print lines on how far it is, each with the channel's name.
    """

    channel: str
    series: "pd.Series"
    folder: Path
    options: FitOptions
    cleaning: Cleaning
    verbose: bool = False
    speaks: bool = False


def fit_channels(
    series: Mapping[str, "pd.Series"],
    out: str | os.PathLike,
    options: FitOptions,
    cleaning: Cleaning,
    workers: int | None,
    tell: Callable[[str], None],
    verbose: bool = False,
    engine: str = "local",
    speaks: bool = False,
) -> dict[str, str]:
    """Fits a simulator to each channel, writes it with its report, and tells what was found.

    Args:
        series: Raw channels by name.
        out: The folder of the models.
        options: How they are fitted.
        cleaning: What to do with dirty values.
        workers: Channels fitted at a time, each in a process of its own; None: one a CPU. Their number changes no bit of the
            simulators. 0 fits them in this process, with the threads that it has.
        tell: Called with each line.
        verbose: Whether to show progress bars, where one channel is fitted at a time.
        engine: Who runs the processes: `local` or `ray`. It changes no bit either.
        speaks: Whether each process of this machine prints a line about every fifteen seconds on how far its channel is.

    Returns:
        For each channel that could not be fitted, why.

    Raises:
        InputError: If a channel has no usable name, or something else stands where a simulator would go, before any is fitted;
            if the engine cannot be used, or a simulator not be written.
    """
    out = make_folder(out)
    if (out / MANIFEST).is_file():
        raise InputError(f"Expected a folder for models. Received: {out}, which is a model itself. Name another --out, or the one above.")
    verbose = verbose and engine == "local" and min(num_cpus() if workers is None else workers, len(series)) <= 1
    here = Path(os.path.abspath(out))
    jobs = [
        Job(name, each, folder_of(here, name), options, cleaning, verbose, speaks and engine == "local") for name, each in series.items()
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
        remove_leftovers(out)  # of processes that were ended
    return {name: failed[name] for name in series if name in failed}


def _fit_in_processes(jobs: Sequence[Job], engine: str, workers: int | None, note: Callable[["Outcome"], None]) -> None:
    """Hands the channels to an engine; one whose process dies again and again does not stop the others."""
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
            for job in suspects:  # one at a time, so that the channel that ends its process is known, and has all the memory
                try:
                    fit([job], 1)
                except ProcessesDiedError:
                    said = (
                        "Expected a process that fits it. Received: only ones that were killed, perhaps for memory. Give it less telemetry."
                    )
                    note(Outcome(job.channel, failure=said))
                    del waiting[job.channel]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of a channel.

    Args:
        channel: Its name.
        lines: Those of its reports, if it was fitted.
        failure: Why it was not.
    """

    channel: str
    lines: Sequence[str] = ()
    failure: str | None = None


def fit_or_say(job: Job) -> Outcome:
    """Fits a channel in a process of an engine; what only this channel is to blame for comes back as its failure.

    Raises:
        InputError: If the machine refuses something, which the other channels would meet too.
    """
    try:
        return Outcome(job.channel, fit_job(job))
    except InputError as error:
        return Outcome(job.channel, failure=str(error))
    except (OSError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200] or "more than there is"
        raise InputError(
            f"Expected files and memory as {printable(job.channel)} needs them. Received: {reason}. What was finished is kept; make room."
        ) from error


def fit_job(job: Job) -> list[str]:
    """Cleans, fits and writes one channel, whole or not at all; returns the lines of its reports.

    Raises:
        InputError: If the channel cannot be used.
    """
    progress = Progress(_tell_if_heard, f"{printable(job.channel)}: ") if job.speaks else SILENT
    cleaned = clean(job.series, job.cleaning)
    from enhsim_tf.enhanced_simulator.fitting import fit_channel
    from enhsim_tf.enhanced_simulator.report_figure import channel_figure

    parts = [dataclasses.replace(part, name=job.channel) for part in cleaned.parts]
    simulator, report = fit_channel(parts, job.options, "auto" if job.verbose else 0, progress)
    refuse_foreign(job.folder)  # it has been minutes
    with replace_folder(job.folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", {"realism": report.to_dict(), "cleaning": cleaned.report.to_dict()})
        channel_figure(report).savefig(temporary / "report.png", dpi=200, format="png")
    return [*cleaned.report.lines(), *report.lines()]


def _tell_if_heard(line: str) -> None:
    """Prints a line; whoever has stopped reading stops no fit."""
    try:
        tell(line)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  Python flushes it once more at its end
