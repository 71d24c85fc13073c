"""Options and help texts of the commands for a user's own telemetry. This module imports nothing
slow.
"""

import argparse
from pathlib import Path

from enhsim_tf import __version__
from enhsim_tf.cli.fields import Parser as AnyParser
from enhsim_tf.cli.fields import add_options
from enhsim_tf.common.console import Parser
from enhsim_tf.datasets.options import InjectOptions
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.scoring.options import ScoreOptions
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.source_kinds import SOURCES

EXAMPLES = """\
from telemetry to scores:
  enhsim-tf fit telemetry.csv --out models
  enhsim-tf generate models --windows 10000 --scenario stuck:0.5 --out training.parquet
  enhsim-tf score models new.csv --out scores.parquet

with simulator.csv, a recorded run of your own simulator at the times of the telemetry
(docs/own_simulator.md):
  enhsim-tf fit telemetry.csv --coarse simulator.csv --out models
  enhsim-tf generate models --coarse fault_run.csv --copies 100 --out training.parquet

enhsim-tf fit --help shows the options of fit; generate, verify, score, update and inject have help
texts too. A separate command, python -m enhsim_tf.reproduce, reproduces the paper.
"""
EXIT = (
    "exit code: 0 success; 2 the input or an option is invalid, or at least one of several "
    "channels failed; 130 interrupted"
)
_OWN = "your own simulator"  # the title of a group of options


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parses the command line, without slow imports.

    Args:
        arguments: Arguments of the command. None uses those of the process.

    Raises:
        InputError: If an option is unknown or its value has the wrong type.
    """
    parser = Parser(
        prog="enhsim-tf",
        description="Fits simulators to channels of telemetry, generates labelled training data "
        "with them, and scores new telemetry.",
        epilog=EXAMPLES + EXIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"enhsim-tf {__version__}")
    commands = parser.add_subparsers(
        dest="command", metavar="{fit,generate,verify,score,update,inject}", required=True
    )
    for add in (_add_fit, _add_generate, _add_verify, _add_score, _add_update, _add_inject):
        add(commands)
    options = parser.parse_args(arguments)
    if len(getattr(options, "source", ())) == 1:
        (options.source,) = options.source
    return options


def _command(
    commands: argparse._SubParsersAction,
    name: str,
    short: str,
    description: str | None = None,
    epilog: str = "",
):  # noqa: ANN202
    form = argparse.RawDescriptionHelpFormatter
    return commands.add_parser(
        name, help=short, description=description, epilog=epilog + EXIT, formatter_class=form
    )


def _add_fit(commands: argparse._SubParsersAction) -> None:
    fit = _command(
        commands,
        "fit",
        "fit an enhanced simulator to nominal telemetry",
        "Fits an enhanced simulator to the channels of nominal telemetry. The coarse simulator of "
        "a channel is a square wave, or a\n"
        "constant level if nothing is periodic. The last part of the telemetry is held out, and "
        "the report evaluates the simulator on it.",
    )
    _add_source(fit)
    _add_out(fit, "MODEL_DIR", "output folder, one subfolder for each simulator")
    fit.add_argument(
        "--separately",
        action="store_true",
        help="fit each channel on its own (default: all channels in one simulator)",
    )
    add_options(fit, FitOptions, "window", "enhancer", "noise", "held_out", "num_windows", "epochs")
    _add_workers(fit, "with --separately: channels fitted in parallel")
    coarse = fit.add_argument_group(
        _OWN,
        "fit with a recorded run of your simulator at the times of the telemetry "
        "(docs/own_simulator.md)",
    )
    _add_coarse(coarse)
    _add_repeated(
        coarse,
        "--coarse-column",
        "use only this column of the recorded run (default: all numeric columns)",
    )
    add_options(coarse, FitOptions, "delay_s")
    _add_json(fit)
    add_options(fit, FitOptions, "seed")


def _add_generate(commands: argparse._SubParsersAction) -> None:
    generate = _command(
        commands,
        "generate",
        "generate labelled training data",
        "Generates windows or one continuous series. Labels mark exactly the samples that a "
        "degraded mode has changed, and give\n"
        "the scenario (nominal or the mode), its severity, onset and end.",
        "degraded modes: stuck, drift, gain_loss, friction, dropout, period_change; severity from "
        "0 to 1. The onset is the start\n"
        "of the degraded mode as a share of the window or series (default: 0.25). A channel "
        "without times counts as one sample per second.\n",
    )
    _add_models(generate)
    how_many = generate.add_mutually_exclusive_group()
    how_many.add_argument("--windows", type=int, metavar="N", help="total number of windows")
    how_many.add_argument(
        "--continuous",
        metavar="LENGTH",
        help="length of one continuous series, such as 1d, 6h, 90min or 5000 (samples)",
    )
    generate.add_argument(
        "--start",
        metavar="TIME",
        help="start of the series, such as 2024-01-01 (default: times are seconds from 0)",
    )
    what = (
        "a degraded mode, such as stuck:0.5, of all channels or of one; for ranges such as "
        "stuck:0.2-0.8:0.1-0.9, each window draws its own"
    )
    _add_repeated(generate, "--scenario", what, "[CHANNEL=]MODE:SEVERITY[:ONSET]", [])
    series = generate.add_argument_group(
        "events in a series", "with --continuous; each event is followed by nominal operation"
    )
    add_options(series, InjectOptions, "number", "at", "length")
    _add_timeeval(series)
    generate.add_argument(
        "--nominal-share",
        type=float,
        metavar="SHARE",
        help="share of nominal windows, with --scenario (default: 0.5)",
    )
    _add_repeated(generate, "--channel", "only the simulator of this name")
    out = "a .parquet file (a series may be a .csv file), or a folder for several simulators"
    _add_out(generate, "OUT", out)
    coarse = generate.add_argument_group(
        _OWN, "for models that were fitted with --coarse (docs/own_simulator.md)"
    )
    _add_coarse(coarse)
    coarse.add_argument(
        "--copies",
        type=int,
        metavar="N",
        help="copies of the run, each with different noise (default: 1)",
    )
    _add_cleaning(coarse)
    large = generate.add_argument_group(
        "large data sets",
        "with these options, OUT is a folder of many files (docs/large_data_sets.md)",
    )
    _add_workers(large, "number of worker processes", None)
    add_options(generate, FitOptions, "seed")


def _add_verify(commands: argparse._SubParsersAction) -> None:
    verify = _command(commands, "verify", "verify a large data set against its manifest")
    verify.add_argument(
        "folder", type=Path, metavar="FOLDER", help="output folder of `generate --workers`"
    )


def _add_score(commands: argparse._SubParsersAction) -> None:
    score = _command(
        commands,
        "score",
        "score telemetry by how it differs from nominal telemetry",
        "Writes a score and a flag for each sample of the source. Beside SCORES it writes the "
        "alarms, one per row, to a file that ends in\n"
        ".events.csv: begin (the estimated onset), end, detected (when a scorer that has seen only "
        "the past raises it), peak, duration_s,\n"
        "num_flagged, score, confidence, against (what was learnt, or the new operating point "
        "after a lasting departure), and the\n"
        "views and channels that raised it. The threshold never flags more of the nominal "
        "telemetry of the fit than it is set for.",
    )
    _add_models(score)
    _add_source(score)
    add_options(score, ScoreOptions, "false_alarm_rate")
    _add_coarse(
        score.add_argument_group(
            _OWN, "score the difference between the telemetry and the enhanced run"
        )
    )
    score.add_argument(
        "--figure",
        action="store_true",
        help="draw series, scores and events beside SCORES, as .png",
    )
    _add_out(score, "SCORES", "a .parquet or .csv file; a folder for several simulators")
    _add_json(score)


def _add_update(commands: argparse._SubParsersAction) -> None:
    update = _command(
        commands,
        "update",
        "update simulators with newer nominal telemetry",
        "Fits the simulators again to newer nominal telemetry, and reports what changed, with "
        "errors and alarms of the old and the new\n"
        "simulator on the held-out end of the new telemetry (docs/own_data.md). The old simulators "
        "are kept.",
    )
    _add_models(update)
    _add_source(update)
    _add_coarse(update.add_argument_group(_OWN, "for simulators that were fitted with --coarse"))
    out = "folder for the updated simulators (default: MODEL_DIR-updated)"
    _add_out(update, "NEW_DIR", out, required=False)
    update.add_argument(
        "--replace",
        action="store_true",
        help="replace simulators that are in NEW_DIR, which may be MODEL_DIR",
    )
    add_options(update, FitOptions, "held_out")
    _add_json(update)
    add_options(update, FitOptions, "seed")


def _add_inject(commands: argparse._SubParsersAction) -> None:
    inject = _command(
        commands,
        "inject",
        "put labelled anomalies into nominal telemetry",
        "Puts anomalies into nominal telemetry of your own, at random or given places, and writes "
        "it with labels (docs/inject.md).",
        "kinds: spike, level_shift, ramp, stuck, variance_change, oscillation, dropout, gain, of "
        "each channel on its own;\n"
        "another_time, delay, lost_coupling, common_shift, of several channels in one table\n",
    )
    _add_source(inject)
    names = "kinds", "number", "severity", "noise_sd", "at", "length"
    add_options(inject, InjectOptions, *names)
    _add_timeeval(inject)
    inject.add_argument(
        "--figure",
        action="store_true",
        help="draw the changed channels, with the anomalies, beside OUT, as .png",
    )
    _add_out(inject, "OUT", "a .parquet or .csv file; a folder: a file per channel")
    _add_quiet(inject)
    add_options(inject, InjectOptions, "seed")


# options of several commands


def _add_repeated(
    parser: AnyParser, word: str, text: str, metavar: str = "NAME", default: list[str] | None = None
) -> None:
    parser.add_argument(
        word, action="append", default=default, metavar=metavar, help=f"{text}; may be repeated"
    )


def _add_out(parser: AnyParser, metavar: str, text: str, required: bool = True) -> None:
    parser.add_argument("--out", type=Path, required=required, metavar=metavar, help=text)


def _add_models(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("models", type=Path, metavar="MODEL_DIR", help="output folder of `fit`")


def _add_json(parser: AnyParser) -> None:
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object in place of lines of text"
    )
    _add_quiet(parser)


def _add_quiet(parser: AnyParser) -> None:
    parser.add_argument("--quiet", action="store_true", help="print warnings and errors only")


def _add_workers(parser: AnyParser, text: str, engine: str | None = "local") -> None:
    parser.add_argument("--workers", metavar="auto|N", help=f"{text} (default: auto, one per core)")
    where = (
        "run workers on this machine (default) or with Ray, on the cluster at RAY_ADDRESS "
        "(docs/large_data_sets.md)"
    )
    parser.add_argument("--engine", choices=("local", "ray"), default=engine, help=where)


def _add_timeeval(parser: AnyParser) -> None:
    parser.add_argument(
        "--timeeval",
        action="store_true",
        help="write TimeEval's CSV: timestamp, the channels, is_anomaly",
    )


def _add_source(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="SOURCE", nargs="+", help=SOURCES)
    _add_repeated(parser, "--column", "only this column (default: all numeric columns)")
    time = "the time column (default: detected); give 'none' to use the sample number as the time"
    parser.add_argument("--time", metavar="NAME", help=time)
    add_options(parser, Cleaning, "interval_s")
    table = parser.add_argument_group(
        "tables in other forms", "what is detected unless it is given (docs/forms.md)"
    )
    names = "label_column", "series_column", "part_column", "no_header", "skip_rows", "table"
    add_options(table, Cleaning, *names, "states", "decimal")
    _add_cleaning(parser)


def _add_coarse(parser: AnyParser) -> None:
    parser.add_argument(
        "--coarse", metavar="SOURCE", help="recorded run of the simulator: " + SOURCES
    )
    parser.add_argument(
        "--coarse-time", metavar="NAME", help="the time column of that run (default: detected)"
    )
    start = (
        "time in UTC of the zero of that run, such as 2024-03-01T00:00:00, if its times count from "
        "zero"
    )
    parser.add_argument("--coarse-start", metavar="TIME", help=start)


def _add_cleaning(parser: AnyParser) -> None:
    names = "time_format", "missing_values", "timezone", "max_fill", "fill", "drop_bad"
    add_options(parser, Cleaning, *names)
