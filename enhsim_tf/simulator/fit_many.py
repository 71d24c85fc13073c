"""Fits simulators to the channels of a source: one for all channels together, or one for each, in parallel worker processes.

Each simulator gets a folder of its own, for example `MODEL_DIR/volts/`, with the files of `EnhancedSimulator.save`, `report.json` and
`report.png`.
"""

import contextlib
import dataclasses
import os
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_folder, write_json
from enhsim_tf.common.console import SILENT, Progress, tell
from enhsim_tf.common.errors import InputError, printable, spoken
from enhsim_tf.common.parallel import engines
from enhsim_tf.common.parallel.local import ProcessesDiedError
from enhsim_tf.common.size_limits import short_reason
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.simulator.model_folder import MANIFEST, folder_of, name_of_channels, refuse_foreign
from enhsim_tf.simulator.options import FitOptions
from enhsim_tf.telemetry.cleaning.clean import Cleaned, Cleaning, clean
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.series import check_values


@dataclasses.dataclass(frozen=True)
class Job:
    """Channels to fit, together if there are several. The fields are arguments of `fit_channels`; `out` is absolute."""

    series: Mapping[str, pd.Series]
    out: Path
    options: FitOptions
    cleaning: Cleaning
    speaks: bool = False
    read_run: Callable[..., Recording] | None = None
    commands: np.ndarray | None = None

    @property
    def name(self) -> str:
        """Name of the channels."""
        return name_of_channels(list(self.series))


@dataclasses.dataclass
class Outcome:
    """What became of a job: lines to print, the report of each simulator by the name of its channels, and why other channels failed."""

    name: str
    lines: list[str] = dataclasses.field(default_factory=list)
    reports: dict[str, dict] = dataclasses.field(default_factory=dict)
    failed: dict[str, str] = dataclasses.field(default_factory=dict)


def fit_channels(
    series: Mapping[str, pd.Series],
    out: str | os.PathLike,
    options: FitOptions,
    cleaning: Cleaning,
    tell: Callable[[str], None],
    separately: bool = False,
    workers: int | None = None,
    engine: str = "local",
    speaks: bool = False,
    read_run: Callable[..., Recording] | None = None,
    commands: np.ndarray | None = None,
) -> tuple[dict[str, dict], dict[str, str]]:
    """Fits simulators to channels, saves them together with their reports, and prints the reports.

    Args:
        series: Raw values of each channel, by the channel's name.
        out: Output folder for all models.
        options: Options of the fit.
        cleaning: Settings of the cleaning.
        tell: Function that is called with each line of output.
        separately: Whether each channel gets a simulator of its own.
        workers: Number of processes. None: one per CPU; 0: all in this process. Neither it nor the engine changes the results.
        engine: How worker processes are run: `local` or `ray`.
        speaks: Whether to print lines of progress.
        read_run: Reads the run of a coarse simulator, with the argument `interval_s` of `read_recording`; None if there is none.
        commands: Commands of the samples of a single channel, shape `(samples, commands)`, or None.

    Returns:
        The reports by the names of their channels, and for each channel that could not be fitted the reason.

    Raises:
        InputError: Before any fit, if a channel's name cannot be used for a folder or an output folder contains something other
            than a saved simulator. Also if the engine is not available or a simulator cannot be written.
    """
    here, speaks = Path(os.path.abspath(out)), speaks and engine == "local"
    if (here / MANIFEST).is_file():
        raise InputError(
            f"Expected a folder for models. Received: {out}, which is a model itself. Give another --out, or its parent folder."
        )
    groups = [{name: each} for name, each in series.items()] if separately else [dict(series)]
    jobs = [Job(group, here, options, cleaning, speaks, read_run, commands) for group in groups]
    for job in jobs:
        for name in (job.name, *job.series):
            refuse_foreign(folder_of(here, name))
    new_folders = [each for each in (here, *here.parents) if not each.exists()]
    reports: dict[str, dict] = {}
    failed: dict[str, str] = {}
    in_this_process = workers == 0 or (len(jobs) == 1 and engine == "local")
    try:
        remove_leftovers(make_folder(here))
        for outcome in map(fit_or_say, jobs) if in_this_process else _fitted_by_processes(jobs, engine, workers):
            reports, failed = reports | outcome.reports, failed | outcome.failed
            for line in outcome.lines:
                tell(line)
    finally:
        remove_leftovers(here)  # temporary files of workers that were killed
        with contextlib.suppress(OSError):
            for folder in new_folders:
                folder.rmdir()  # only if it is empty, because nothing was fitted
    return reports, {name: failed[name] for name in series if name in failed}


def _fitted_by_processes(jobs: Sequence[Job], engine: str, workers: int | None) -> Iterator[Outcome]:
    """Fits the channels with an engine. A channel whose worker dies repeatedly is reported and does not stop the others."""
    batches = [(jobs, workers)]
    while batches:
        some, workers = batches.pop()
        waiting = {job.name: job for job in some}
        try:
            with contextlib.closing(engines.run(engine, fit_or_say, some, workers)) as running:
                for outcome in running:
                    del waiting[outcome.name]
                    yield outcome
        except ProcessesDiedError as died:
            suspects = [waiting.pop(job.name) for job in died.items if job.name in waiting]
            if not suspects:
                raise
            if len(some) == 1:
                what = "Expected a worker process to fit this channel. Received: all of them were killed, perhaps for lack of memory."
                yield Outcome(some[0].name, failed=dict.fromkeys(some[0].series, f"{what} Give less telemetry."))
                continue
            batches += [(list(waiting.values()), workers)] if waiting else []
            # one at a time, to find the one that kills its worker, and to give it all the memory
            batches += [([job], 1) for job in suspects]


def fit_or_say(job: Job) -> Outcome:
    """Fits the channels of a job. Errors that concern only some of them are returned; lack of disk space or memory is raised as InputError."""
    cleaned, outcome = {}, Outcome(job.name)
    for name, series in job.series.items():
        with _failing(outcome, [name]):
            cleaned[name] = _cleaned(name, series, job.cleaning)
    outcome.lines += lines_of([each.report for each in cleaned.values()])
    for telemetry in join_channels({name: each.parts for name, each in cleaned.items()}) if cleaned else []:
        with _failing(outcome, telemetry.columns):
            _fit_group(telemetry, cleaned, job, outcome)
    return outcome


def _cleaned(name: str, series: pd.Series, cleaning: Cleaning) -> Cleaned:
    cleaned = clean(series, cleaning)
    check_values(np.concatenate([part.values for part in cleaned.parts]), name)
    return dataclasses.replace(cleaned, parts=tuple(dataclasses.replace(part, name=name) for part in cleaned.parts))


@contextlib.contextmanager
def _failing(outcome: Outcome, names: Sequence[str]) -> Iterator[None]:
    """Notes why work on channels could not be done."""
    try:
        yield
    except InputError as error:
        outcome.failed |= dict.fromkeys(names, str(error))
    except BrokenPipeError:  # the reader has left, which ends the command
        raise
    except (OSError, MemoryError) as error:  # concerns all channels
        said = f"{short_reason(error)}. Finished channels are kept; free some space."
        raise InputError(f"Expected enough memory and disk space. Received: {said}") from error
    except Exception as error:  # noqa: BLE001  a defect that one channel meets must not lose the others
        where, reason = traceback.extract_tb(error.__traceback__)[-1], " ".join(str(error).split())[:200]
        said = f"{type(error).__name__}: {reason}, in {Path(where.filename).name}, line {where.lineno}"
        outcome.failed |= dict.fromkeys(names, f"Expected a fit. Received: {said}. Please report this defect.")


def _fit_group(telemetry: Recording, cleaned: Mapping[str, Cleaned], job: Job, outcome: Outcome) -> None:
    """Fits and saves one simulator. Nothing is written if a step fails."""
    from enhsim_tf.simulator.figures import report_figure
    from enhsim_tf.simulator.fitting import fit

    name = name_of_channels(telemetry.columns)
    progress = Progress(tell, f"{spoken(telemetry.columns)}: ") if job.speaks else SILENT
    commands = job.commands if len(job.series) == 1 else None
    interval_s = telemetry.interval_s if telemetry.start is not None else None
    run = None if job.read_run is None else job.read_run(interval_s=interval_s)
    simulator, report = fit(telemetry, run, job.options, progress, commands)
    folder = folder_of(job.out, name)
    refuse_foreign(folder)  # checked again, because the fit took time
    instead = ", in place of the one that was there" if (folder / MANIFEST).is_file() else ""
    found = {"report": report.to_dict(), "cleaning": {channel: cleaned[channel].report.to_dict() for channel in telemetry.columns}}
    with replace_folder(folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", found)
        report_figure(report).savefig(temporary / "report.png", dpi=200, format="png")
    outcome.reports[name] = found | {"folder": str(folder)}
    here = os.path.relpath(folder)
    shown = folder if here.startswith("..") else here  # from here, its full path if it is elsewhere
    outcome.lines += [*report.lines(), f"{printable(name)}: simulator, report.json and report.png in {shown}/{instead}"]
