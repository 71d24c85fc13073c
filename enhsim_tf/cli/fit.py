"""`enhsim-tf fit`: fits simulators to the channels of telemetry: one to all together, or one to each, in parallel worker processes.

Each simulator gets a folder of its own, for example `MODEL_DIR/volts/`, with the files of `EnhancedSimulator.save`, `report.json` and
`report.png`.
"""

import argparse
import contextlib
import dataclasses
import functools
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from enhsim_tf.cli.options import tell_failed
from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_folder, write_json
from enhsim_tf.common.console import SILENT, Progress, tell
from enhsim_tf.common.errors import InputError, printable, spoken
from enhsim_tf.common.parallel import engines
from enhsim_tf.common.parallel.local import ProcessesDiedError
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.simulator.model_folder import MANIFEST, folder_of, name_of_channels, refuse_foreign
from enhsim_tf.simulator.report import Report
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.clean import Cleaned, clean
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.series import check_values
from enhsim_tf.telemetry.sources import read_source

Group = Mapping[str, pd.Series]
"""Raw values of channels to fit, by their names; together if there are several."""


@dataclasses.dataclass
class Outcome:
    """What became of a group: lines to print, the report of each simulator by the name of its channels, and why other channels failed."""

    name: str
    lines: list[str] = dataclasses.field(default_factory=list)
    reports: dict[str, dict] = dataclasses.field(default_factory=dict)
    failed: dict[str, str] = dataclasses.field(default_factory=dict)


def run_fit(options: argparse.Namespace) -> int:
    """Fits one simulator to all channels of the source, or one to each, and returns the exit code."""
    say = (lambda line: None) if options.json else tell
    say("reading ...")
    read_run = None
    if options.coarse is not None:
        given = (
            options.coarse,
            options.coarse_column,
            options.coarse_time,
            options.cleaning.of_run(min_part=2),
        )
        read_run = functools.partial(read_recording, *given, start=options.coarse_start)
    series = read_source(options.source, options.column, options.time, options.cleaning)
    reports, failed = fit_channels(
        series, options, say, read_run, None if read_run is not None else series.commands
    )
    if options.json:
        tell(json.dumps(reports))
    return tell_failed(failed)


def fit_channels(
    series: Group,
    options: argparse.Namespace,
    say: Callable[[str], None],
    read_run: Callable[..., Recording] | None = None,
    commands: np.ndarray | None = None,
) -> tuple[dict[str, dict], dict[str, str]]:
    """Fits simulators to channels and saves them with their reports. Engine and number of workers do not change the results.

    `say` is called with each line of output. `read_run`, None if there is no run, is called with the `interval_s` of `read_recording`.

    Returns:
        The reports by the names of their channels, and for each channel that could not be fitted the reason.

    Raises:
        InputError: Before any fit, if a name or an output folder cannot be used, or if the engine is not available.
    """
    out = Path(os.path.abspath(options.out))
    if (out / MANIFEST).is_file():
        raise InputError(
            f"Expected a folder for models. Received: {options.out}, which is a model itself. Give another --out."
        )
    groups = (
        [{name: each} for name, each in series.items()] if options.separately else [dict(series)]
    )
    for name in (*map(_name, groups), *series):
        refuse_foreign(folder_of(out, name))
    new_folders = [each for each in (out, *out.parents) if not each.exists()]
    reports: dict[str, dict] = {}
    failed: dict[str, str] = {}
    work = functools.partial(
        fit_or_say, out=out, options=options, read_run=read_run, commands=commands
    )
    in_this_process = options.workers == 0 or (len(groups) == 1 and options.engine == "local")
    try:
        make_folder(out)
        for outcome in (
            map(work, groups)
            if in_this_process
            else _fitted_by_processes(work, groups, options.engine, options.workers)
        ):
            reports, failed = reports | outcome.reports, failed | outcome.failed
            for line in outcome.lines:
                say(line)
    finally:
        remove_leftovers(out)  # temporary files of workers that were killed, also of an earlier run
        with contextlib.suppress(OSError):
            for folder in new_folders:
                folder.rmdir()  # only if it is empty, because nothing was fitted
    return reports, {name: failed[name] for name in series if name in failed}


def _name(group: Group) -> str:
    return name_of_channels(list(group))


def _fitted_by_processes(
    work: Callable[[Group], Outcome], groups: Sequence[Group], engine: str, workers: int | None
) -> Iterator[Outcome]:
    """Fits the channels with an engine. If its workers keep dying, the channels that they had taken fail, and the others are fitted."""
    waiting = {_name(group): group for group in groups}
    while waiting:
        try:
            with contextlib.closing(
                engines.run(engine, work, list(waiting.values()), workers)
            ) as running:
                for outcome in running:
                    del waiting[outcome.name]
                    yield outcome
        except ProcessesDiedError as died:
            for group in died.items:
                del waiting[_name(group)]
                yield Outcome(_name(group), failed=dict.fromkeys(group, str(died)))


def fit_or_say(
    group: Group,
    out: Path,
    options: argparse.Namespace,
    read_run: Callable[..., Recording] | None,
    commands: np.ndarray | None,
) -> Outcome:
    """Fits the channels of a group. An InputError about some of them is returned; lack of disk space or memory is raised."""
    from enhsim_tf.simulator.fitting import fit

    cleaned, outcome = {}, Outcome(_name(group))
    for name, series in group.items():
        try:
            found = clean(series, options.cleaning)
            check_values(np.concatenate([part.values for part in found.parts]), name)
            cleaned[name] = found
        except InputError as error:
            outcome.failed[name] = str(error)
    outcome.lines += lines_of([each.report for each in cleaned.values()])
    groups = join_channels({name: each.parts for name, each in cleaned.items()}) if cleaned else []
    if len(groups) > 1:
        others = "; ".join(spoken(each.columns) for each in groups)
        outcome.lines.append(
            f"channels of other sampling intervals or times get a simulator of their own: {others}"
        )
    speaks = options.engine == "local" and not options.json
    for telemetry in groups:
        progress = Progress(tell, f"{spoken(telemetry.columns)}: ") if speaks else SILENT
        interval_s = telemetry.interval_s if telemetry.start is not None else None
        try:
            run = None if read_run is None else read_run(interval_s=interval_s)
            fitted = fit(
                telemetry, run, options.chosen, progress, commands if len(group) == 1 else None
            )
            _save(*fitted, cleaned, out, outcome)
        except InputError as error:
            outcome.failed |= dict.fromkeys(telemetry.columns, str(error))
    return outcome


def _save(
    simulator: EnhancedSimulator,
    report: Report,
    cleaned: Mapping[str, Cleaned],
    out: Path,
    outcome: Outcome,
) -> None:
    """Saves a fitted simulator with its report. Nothing is written if a step fails."""
    from enhsim_tf.simulator.figures import report_figure

    name = name_of_channels(simulator.channels)
    folder = folder_of(out, name)
    refuse_foreign(folder)  # checked again, because the fit took time
    instead = ", in place of the one that was there" if (folder / MANIFEST).is_file() else ""
    found = {
        "report": report.to_dict(),
        "cleaning": {channel: cleaned[channel].report.to_dict() for channel in simulator.channels},
    }
    with replace_folder(folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", found)
        report_figure(report).savefig(temporary / "report.png", dpi=200, format="png")
    outcome.reports[name] = found | {"folder": str(folder)}
    here = os.path.relpath(folder)
    shown = folder if here.startswith("..") else here  # from here, its full path if it is elsewhere
    said, warned = report.lines(), len(report.warnings())
    saved = f"{printable(name)}: simulator, report.json and report.png in {shown}/{instead}"
    outcome.lines = [*said[:warned], *outcome.lines, *said[warned:], saved]  # warnings come first
