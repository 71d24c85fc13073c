"""What the commands for telemetry of one's own can be asked: their options and their help. Nothing slow is imported."""

import argparse
from pathlib import Path

from enhsim_tf.common.console import Parser
from enhsim_tf.enhanced_simulator.fit_options import FEWEST_SAMPLES

EXAMPLES = """\
from telemetry to scores:
  python -m enhsim_tf fit telemetry.csv --out models
  python -m enhsim_tf generate models --windows 10000 --scenario stuck:0.5 --out training.parquet
  python -m enhsim_tf score models new.csv --out scores.parquet

python -m enhsim_tf fit --help (generate, verify, score) tells each command's options. The paper's reproduction is another
command: python -m enhsim_tf.reproduce.
"""
SOURCE = "a .csv, .parquet or .npy file, a store's folder, folder#channel, or influxdb://bucket/measurement/field?tag=value"
DETECTORS = (
    "limit-check",
    "pca-residual",
    "nearest-neighbours",
    "isolation-forest",
    "one-class-svm",
    "dense-autoencoder",
    "convolutional-autoencoder",
)
EXIT = "exit code: 0 done, 2 the input or an option cannot be used (with several channels: of one of them), 130 interrupted"


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Reads the command line; imports nothing that is slow.

    Raises:
        InputError: If an option is unknown or its value is not of its kind.
    """
    form = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = Parser(
        prog="python -m enhsim_tf",
        description="Realistic telemetry from telemetry: fit a simulator to a channel, generate training data, score new telemetry.",
        epilog=EXAMPLES + EXIT,
        **form,
    )
    commands = parser.add_subparsers(dest="command", metavar="{fit,generate,verify,score}", required=True)

    fit = commands.add_parser(
        "fit",
        help="fit an enhanced simulator to nominal telemetry",
        description="Fits an enhanced simulator to each channel of nominal, periodic telemetry, and reports how realistic it is on the end\n"
        "of the telemetry, which it has not seen. About a minute and a half a channel on two cores.",
        epilog=EXIT,
        **form,
    )
    _add_source(fit)
    fit.add_argument("--out", type=Path, required=True, metavar="MODEL_DIR", help="where the simulators go, a folder a channel")
    fit.add_argument(
        "--window", type=int, metavar="N", help=f"samples of a window, at least {FEWEST_SAMPLES} (default: two periods, from 64 to 500)"
    )
    fit.add_argument(
        "--noise", choices=("convolutional", "paper"), default="convolutional", help="networks of the noise (default: %(default)s)"
    )
    fit.add_argument("--held-out", type=float, default=0.2, metavar="SHARE", help="end of the telemetry kept for the report (default: 0.2)")
    fit.add_argument("--num-windows", type=int, default=2_500, metavar="N", help="training windows (default: 2500)")
    fit.add_argument("--epochs", type=int, default=6, metavar="N", help="passes of the enhancer over them (default: 6)")
    fit.add_argument("--iterations", type=int, default=1_000, metavar="N", help="adversarial iterations of the noise (default: 1000)")
    fit.add_argument("--workers", metavar="auto|N", help="channels fitted at a time, two threads each (default: auto, one a core)")
    fit.add_argument(
        "--engine", choices=("local", "ray"), default="local", help="who fits them: this machine (default), or Ray (docs/fleet.md)"
    )
    _add_seed(fit)

    generate = commands.add_parser(
        "generate",
        help="generate labelled training data",
        description="Generates windows, or one continuous series, with labels: nominal or a degraded mode, its severity and onset.",
        epilog="degraded modes: stuck, drift, gain_loss, friction, dropout, period_change; severity from 0 to 1; onset, when it sets in, as a\n"
        "share of the window or series (default: 0.25). A channel without times has a sample a second.\n" + EXIT,
        **form,
    )
    generate.add_argument("models", type=Path, metavar="MODEL_DIR", help="what `fit` wrote")
    how_many = generate.add_mutually_exclusive_group()
    how_many.add_argument("--windows", type=int, metavar="N", help="windows in all")
    how_many.add_argument("--continuous", metavar="LENGTH", help="one series instead, such as 1d, 6h, 90min or 5000 (samples)")
    generate.add_argument("--start", metavar="TIME", help="when the series begins, such as 2024-01-01 (default: time is counted from 0)")
    generate.add_argument(
        "--scenario",
        action="append",
        default=[],
        metavar="MODE:SEVERITY[:ONSET]",
        help="a degraded mode, such as stuck:0.5; may be repeated",
    )
    generate.add_argument(
        "--nominal-share", type=float, metavar="SHARE", help="share of nominal windows beside those of scenarios (default: 0.5)"
    )
    generate.add_argument("--channel", action="append", metavar="NAME", help="only this channel; may be repeated")
    generate.add_argument(
        "--out", type=Path, required=True, metavar="OUT", help="a .parquet file; a folder where there are several channels"
    )
    large = generate.add_argument_group("large data sets", "with any of these, OUT is a folder of many files (docs/fleet.md)")
    large.add_argument("--workers", metavar="auto|N", help="processes (default: auto, one a core)")
    large.add_argument(
        "--engine", choices=("local", "ray"), help="who runs them: this machine (default), or Ray, on the cluster of RAY_ADDRESS"
    )
    large.add_argument(
        "--scenarios", type=Path, metavar="FILE", help="YAML: scenarios with shares and ranges, several models (docs/scenarios.md)"
    )
    _add_seed(generate, None)  # a scenario file may give another

    verify = commands.add_parser("verify", help="check a large data set against its manifest", epilog=EXIT, **form)
    verify.add_argument("folder", type=Path, metavar="FOLDER", help="what `generate --workers` wrote")
    verify.set_defaults(seed=0)

    score = commands.add_parser(
        "score",
        help="score telemetry with a detector trained on generated telemetry",
        description="Trains a detector on generated nominal telemetry only, and writes a score and a flag for each sample.",
        epilog=f"detectors: {', '.join(DETECTORS)}\n{EXIT}",
        **form,
    )
    score.add_argument("models", type=Path, metavar="MODEL_DIR", help="what `fit` wrote")
    _add_source(score)
    score.add_argument(
        "--detector", choices=DETECTORS, default="pca-residual", metavar="NAME", help="which detector (default: %(default)s)"
    )
    score.add_argument("--windows", type=int, default=2_000, metavar="N", help="generated windows that it learns from (default: 2000)")
    score.add_argument("--false-alarm-rate", type=float, default=0.01, metavar="SHARE", help="samples that may be flagged (default: 0.01)")
    score.add_argument("--out", type=Path, required=True, metavar="SCORES", help="a .parquet or .csv file; a folder for several channels")
    _add_seed(score)
    return parser.parse_args(arguments)


def _add_seed(parser: argparse.ArgumentParser, default: int | None = 0) -> None:
    parser.add_argument("--seed", type=int, default=default, help="seed of everything drawn (default: 0)")


def _add_source(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="SOURCE", help=SOURCE)
    parser.add_argument("--column", action="append", metavar="NAME", help="only this column; may be repeated (default: all of numbers)")
    parser.add_argument("--time", metavar="NAME", help="the column of times (default: found; none: samples are counted)")
    parser.add_argument("--interval", type=float, metavar="SECONDS", help="sampling interval (default: the one most rows have)")
    parser.add_argument("--timezone", metavar="ZONE", help="zone of times without one, such as Europe/Berlin (default: UTC)")
    parser.add_argument("--max-fill", type=int, default=5, metavar="N", help="longest gap filled by a straight line (default: 5 samples)")
    parser.add_argument("--drop-bad", action="store_true", help="leave out what is no number or no time, counted, instead of refusing it")
