"""`python -m enhsim_tf`: telemetry of one's own, from a table to a trained simulator, training data and scores."""

import argparse
import os
import sys
from pathlib import Path

from enhsim_tf.terminal import Parser, finish

EXAMPLES = """\
three commands:
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
EXIT = "exit code: 0 done, 2 the input or an option cannot be used"


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
    fit.add_argument("--window", type=int, metavar="N", help="samples of a window (default: two periods, from 64 to 500)")
    fit.add_argument(
        "--noise", choices=("convolutional", "paper"), default="convolutional", help="networks of the noise (default: %(default)s)"
    )
    fit.add_argument("--held-out", type=float, default=0.2, metavar="SHARE", help="end of the telemetry kept for the report (default: 0.2)")
    fit.add_argument("--num-windows", type=int, default=2_500, metavar="N", help="training windows (default: 2500)")
    fit.add_argument("--epochs", type=int, default=6, metavar="N", help="passes of the enhancer over them (default: 6)")
    fit.add_argument("--iterations", type=int, default=1_000, metavar="N", help="adversarial iterations of the noise (default: 1000)")
    fit.add_argument("--workers", type=int, metavar="N", help="channels fitted at a time (default: one a core)")
    _add_seed(fit)

    generate = commands.add_parser(
        "generate",
        help="generate labelled training data",
        description="Generates windows, or one continuous series, with labels: nominal or a degraded mode, its severity and onset.",
        epilog="degraded modes: stuck, drift, gain_loss, friction, dropout, period_change\n" + EXIT,
        **form,
    )
    generate.add_argument("models", type=Path, metavar="MODEL_DIR", help="what `fit` wrote")
    how_many = generate.add_mutually_exclusive_group()
    how_many.add_argument("--windows", type=int, metavar="N", help="windows in all")
    how_many.add_argument("--continuous", metavar="LENGTH", help="one series instead, such as 1d, 6h, 90min or 5000 (samples)")
    generate.add_argument(
        "--scenario",
        action="append",
        default=[],
        metavar="MODE:SEVERITY[:ONSET]",
        help="a degraded mode, such as stuck:0.5; may be repeated",
    )
    generate.add_argument(
        "--nominal-share", type=float, default=0.5, metavar="SHARE", help="nominal windows, where there are scenarios (default: 0.5)"
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
    _add_seed(generate)

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


def _add_seed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=0, help="seed of everything drawn (default: 0)")


def _add_source(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="SOURCE", help=SOURCE)
    parser.add_argument("--column", action="append", metavar="NAME", help="only this column; may be repeated (default: all of numbers)")
    parser.add_argument("--time", metavar="NAME", help="the column of times (default: found; none: samples are counted)")
    parser.add_argument("--interval", type=float, metavar="SECONDS", help="sampling interval (default: the one most rows have)")
    parser.add_argument("--timezone", metavar="ZONE", help="zone of times without one, such as Europe/Berlin (default: UTC)")
    parser.add_argument("--max-fill", type=int, default=5, metavar="N", help="longest gap filled by a straight line (default: 5 samples)")
    parser.add_argument("--drop-bad", action="store_true", help="leave out what is no number or no time, counted, instead of refusing it")


def run(options: argparse.Namespace) -> int:
    """Runs what the options ask for and returns the exit code."""
    from enhsim_tf.errors import InputError

    if not 0 <= options.seed < 2**31:
        raise InputError(f"Expected a seed from 0 to before 2**31. Received: --seed {options.seed}.")
    return {"fit": run_fit, "generate": run_generate, "verify": run_verify, "score": run_score}[options.command](options)


def run_fit(options: argparse.Namespace) -> int:
    """Fits a simulator to each channel of the source."""
    from enhsim_tf.errors import InputError

    counts = {"num_windows": options.num_windows, "epochs": options.epochs, "num_iterations": options.iterations}
    if min(counts["num_windows"], counts["epochs"]) < 1 or options.iterations < 0 or (options.workers or 1) < 1:
        raise InputError("Expected at least one window, epoch and worker, and no negative number of iterations. Received: less.")
    if not 0 <= options.held_out <= 0.5 or (options.window or 16) < 16:
        raise InputError(
            f"Expected --held-out from 0 to 0.5 and --window of at least 16. Received: {options.held_out} and {options.window}."
        )
    from enhsim_tf.channels import fit_channels  # pandas takes a while
    from enhsim_tf.sources import read_source

    cleaning = cleaning_of(options, options.window or 64)
    series = read_source(options.source, options.column, options.time, cleaning)
    chosen = {"window": options.window, "noise": options.noise, "held_out": options.held_out, "seed": options.seed} | counts
    workers = options.workers or min(len(series), os.cpu_count() or 1)
    failed = fit_channels(series, options.out, chosen, cleaning, workers, tell, sys.stdout.isatty())
    for channel, reason in failed.items():
        print(f"error: {channel}: {reason}", file=sys.stderr)
    return 2 if failed else 0


def run_generate(options: argparse.Namespace) -> int:
    """Generates labelled training data from each channel's simulator."""
    from enhsim_tf.channels import models_of
    from enhsim_tf.errors import InputError
    from enhsim_tf.training_sets import num_samples_of, parse_scenario, shares_of, write_series_labelled, write_windows_labelled

    if options.workers or options.engine or options.scenarios:
        from enhsim_tf.fleet_command import run_fleet

        return run_fleet(options, tell)
    scenarios = [parse_scenario(text) for text in options.scenario]
    if options.windows is None and options.continuous is None:
        raise InputError("Expected --windows or --continuous. Received: neither.")
    if options.windows is not None and options.windows < 1:
        raise InputError(f"Expected at least one window. Received: --windows {options.windows}.")
    if options.continuous is not None and len(scenarios) > 1:
        raise InputError(f"Expected at most one --scenario with --continuous. Received: {len(scenarios)}. Write a series for each.")
    models = chosen_of(models_of(options.models), options.channel)
    paths = outputs_of(options.out, models, (".parquet",))
    shares = shares_of(scenarios, options.windows or 0, options.nominal_share, options.seed)
    if options.continuous is not None:
        num_samples_of(options.continuous, 1.0)  # refused before TensorFlow is loaded
    for channel, folder in models.items():
        simulator = load(folder)
        if options.continuous is None:
            write_windows_labelled(paths[channel], simulator, shares)
            what = f"{options.windows:,} windows of {simulator.window} samples"
        else:
            length = num_samples_of(options.continuous, simulator.interval_s)
            write_series_labelled(paths[channel], simulator, length, scenarios[0] if scenarios else None, options.seed)
            what = f"{length:,} samples"
        tell(f"{channel}: {what} in {paths[channel]}")
    return 0


def run_verify(options: argparse.Namespace) -> int:
    """Checks a large data set."""
    from enhsim_tf.fleet import verify

    return verify(options.folder, tell)


def run_score(options: argparse.Namespace) -> int:
    """Scores each channel of the source that has a simulator."""
    from enhsim_tf import detectors
    from enhsim_tf.channels import models_of
    from enhsim_tf.cleaning import clean
    from enhsim_tf.errors import InputError
    from enhsim_tf.scoring import ScoreOptions, score_channel, write_scores
    from enhsim_tf.sources import read_source

    detector = {name.casefold().replace(" ", "-"): name for name in detectors.DETECTORS}[options.detector]
    chosen = ScoreOptions(detector, options.windows, options.false_alarm_rate, options.seed)
    models = models_of(options.models)
    cleaning = cleaning_of(options, 2)
    series = read_source(options.source, options.column, options.time, cleaning)
    if len(models) == 1 and len(series) == 1:  # one of each belong together, whatever they are called
        models = dict(zip(series, models.values(), strict=True))
    unknown = [name for name in series if name not in models]
    if unknown:
        known = ", ".join(list(models)[:8])
        raise InputError(f"Expected channels that were fitted: {known}. Received: {unknown[0]!r}. Name the others with --column.")
    paths = outputs_of(options.out, series, (".parquet", ".csv"))
    for channel, raw in series.items():
        cleaned = clean(raw, cleaning)
        frame = score_channel(load(models[channel]), cleaned.parts, chosen)
        write_scores(paths[channel], frame)
        tell("\n".join(cleaned.report.lines()))
        tell(
            f"{channel}: {frame['flag'].mean():.1%} of {len(frame):,} samples flagged by {chosen.detector}, set to flag "
            f"{chosen.false_alarm_rate:.1%} of nominal ones; {int(frame['score'].isna().sum()):,} not scored; in {paths[channel]}"
        )
    return 0


def cleaning_of(options: argparse.Namespace, min_part: int):
    """The options of cleaning."""
    from enhsim_tf.cleaning import Cleaning

    bad = "drop" if options.drop_bad else "refuse"
    return Cleaning(
        interval_s=options.interval,
        timezone=options.timezone,
        on_bad_times=bad,
        on_bad_values=bad,
        max_fill=options.max_fill,
        min_part=min_part,
    )


def chosen_of(models: dict[str, Path], channels: list[str] | None) -> dict[str, Path]:
    """The channels that were named, or all."""
    from enhsim_tf.errors import InputError

    unknown = [name for name in channels or () if name not in models]
    if unknown:
        raise InputError(f"Expected --channel, one of: {', '.join(list(models)[:8])}. Received: {unknown[0]!r}.")
    return {name: models[name] for name in channels or models}


def outputs_of(out: Path, channels, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """A file for each channel: the one that was named, or one a channel in the folder that was named."""
    from enhsim_tf.channels import folder_of
    from enhsim_tf.errors import InputError
    from enhsim_tf.files import make_folder

    names = list(channels)
    if out.suffix in suffixes:
        if len(names) > 1:
            raise InputError(f"Expected a folder for {len(names)} channels. Received: --out {out}. Name a folder, or one channel.")
        make_folder(out.parent)
        return {names[0]: out}
    if out.suffix:
        raise InputError(f"Expected a file that ends in {' or '.join(suffixes)}, or a folder. Received: --out {out}.")
    make_folder(out)
    return {name: folder_of(out, name).with_suffix(suffixes[0]) for name in names}


def load(folder: Path):
    """The simulator of a folder."""
    from enhsim_tf.terminal import start_tensorflow

    start_tensorflow()
    from enhsim_tf.enhanced_simulator import EnhancedSimulator

    return EnhancedSimulator.load(folder)


def tell(line: str) -> None:
    """Prints a line at once."""
    print(line, flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; a user's mistake is one line and exit code 2."""
    return finish(lambda: run(parse(arguments)), "interrupted; what was finished is kept")


if __name__ == "__main__":
    sys.exit(main())
