"""`enhsim-tf fit`: fits simulators to the channels of telemetry: one to all together, or one to
each, in parallel worker processes.

Each simulator gets a folder of its own, for example `MODEL_DIR/volts/`, with the files of
`EnhancedSimulator.save`, `report.json` and `report.png`.
"""

import argparse
import contextlib
import dataclasses
import functools
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from enhsim_tf.cli.shared import cleaned_channels, failing, read_channels, read_run, tell_failed
from enhsim_tf.common.atomic_files import make_folder, remove_leftovers, replace_folder, write_json
from enhsim_tf.common.console import SILENT, Progress, tell
from enhsim_tf.common.errors import InputError, printable, spoken
from enhsim_tf.common.parallel import engines
from enhsim_tf.common.parallel.local import ProcessesDiedError
from enhsim_tf.fitting.report import Report
from enhsim_tf.simulator.model_folder import MANIFEST, folder_of, name_of_channels, refuse_foreign
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.raw import RawChannel
from enhsim_tf.telemetry.cleaning.report import Report as CleaningReport
from enhsim_tf.telemetry.cleaning.report import lines_of

Group = Mapping[str, RawChannel]
"""Raw values of channels to fit, by their names; together if there are several."""


@dataclasses.dataclass
class Outcome:
    """What became of a group: lines to print, the report of each simulator by the name of its
    channels, and the errors by which other channels failed.
    """

    name: str
    lines: list[str] = dataclasses.field(default_factory=list)
    reports: dict[str, dict] = dataclasses.field(default_factory=dict)
    failed: dict[str, Exception] = dataclasses.field(default_factory=dict)


def run_fit(options: argparse.Namespace) -> int:
    """Fits one simulator to all channels of the source, or one to each, and returns the exit
    code.
    """
    say = (lambda line: None) if options.json else tell
    say("reading ...")
    reports, failed = fit_channels(read_channels(options), options, say)
    if options.json:
        tell(json.dumps(reports))
    return tell_failed(failed)


def fit_channels(
    series: Group, options: argparse.Namespace, say: Callable[[str], None]
) -> tuple[dict[str, dict], dict[str, Exception]]:
    """Fits simulators to channels and saves them with their reports. Engine and number of workers
    do not change the results.

    `say` is called with each line of output.

    Returns:
        The reports by the names of their channels, and for each channel that could not be fitted
        the error.

    Raises:
        InputError: Before any fit, if a name or an output folder cannot be used, or if the engine
            is not available.
    """
    out = Path(os.path.abspath(options.out))
    if (out / MANIFEST).is_file():
        raise InputError(
            f"Expected a folder for models. Received: {options.out}, which is a model itself. Give "
            "another --out."
        )
    groups = [{name: raw} for name, raw in series.items()] if options.separately else [dict(series)]
    for name in (*map(_name, groups), *series):
        refuse_foreign(folder_of(out, name))
    reports: dict[str, dict] = {}
    failed: dict[str, Exception] = {}
    work = functools.partial(fit_or_say, out=out, options=options)
    in_this_process = options.workers == 0 or (len(groups) == 1 and options.engine == "local")
    try:
        make_folder(out)
        for outcome in (
            map(work, groups)
            if in_this_process
            else _fitted_by_processes(work, groups, options.engine, options.workers)
        ):
            reports |= outcome.reports
            failed |= outcome.failed
            for line in outcome.lines:
                say(line)
    finally:
        remove_leftovers(out)  # temporary files of workers that were killed, also of an earlier run
    return reports, {name: failed[name] for name in series if name in failed}


def _name(group: Group) -> str:
    return name_of_channels(list(group))


def _fitted_by_processes(
    work: Callable[[Group], Outcome], groups: Sequence[Group], engine: str, workers: int | None
) -> Iterator[Outcome]:
    """Fits the channels with an engine. If its workers keep dying, the channels that they had taken
    fail, and the others are fitted.
    """
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
                yield Outcome(_name(group), failed=dict.fromkeys(group, died))


def fit_or_say(group: Group, out: Path, options: argparse.Namespace) -> Outcome:
    """Fits the channels of a group. Errors about some of them are returned; lack of disk space or
    memory is raised.
    """
    from enhsim_tf.fitting.fit import fit

    outcome = Outcome(_name(group))
    speaks = options.engine == "local" and not options.json and not options.quiet
    with failing(group, outcome.failed):
        groups, cleaned = cleaned_channels(group, options.cleaning, outcome.failed)
        outcome.lines += lines_of(list(cleaned.values()))
        if len(groups) > 1:
            others = "; ".join(spoken(telemetry.columns) for telemetry in groups)
            outcome.lines.append(
                "channels of other sampling intervals or times get a simulator of their own: "
                f"{others}"
            )
        for telemetry in groups:
            progress = Progress(tell, f"{spoken(telemetry.columns)}: ") if speaks else SILENT
            interval_s = telemetry.interval_s if telemetry.start is not None else None
            with failing(telemetry.columns, outcome.failed):
                run = None
                if options.coarse is not None:
                    cleaning = options.cleaning.of_run(min_part=2)
                    run = read_run(options, options.coarse_column, cleaning, interval_s)
                simulator, report = fit(telemetry, run, options.chosen, progress)
                _save(simulator, report, cleaned, out, outcome)
    return outcome


def _save(
    simulator: EnhancedSimulator,
    report: Report,
    cleaned: Mapping[str, CleaningReport],
    out: Path,
    outcome: Outcome,
) -> None:
    """Saves a fitted simulator with its report. Nothing is written if a step fails."""
    from enhsim_tf.fitting.figure import report_figure

    name = name_of_channels(simulator.channels)
    folder = folder_of(out, name)
    refuse_foreign(folder)  # checked again, because the fit took time
    instead = ", in place of the one that was there" if (folder / MANIFEST).is_file() else ""
    content = {
        "report": report.to_dict(),
        "cleaning": {channel: cleaned[channel].to_dict() for channel in simulator.channels},
    }
    with replace_folder(folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", content)
        report_figure(report).savefig(temporary / "report.png", dpi=200, format="png")
    outcome.reports[name] = content | {"folder": str(folder)}
    here = os.path.relpath(folder)
    shown = folder if here.startswith("..") else here  # from here, its full path if it is elsewhere
    said = report.lines()
    warned = len(report.warnings())
    saved = f"{printable(name)}: simulator, report.json and report.png in {shown}/{instead}"
    outcome.lines = [*said[:warned], *outcome.lines, *said[warned:], saved]  # warnings come first
