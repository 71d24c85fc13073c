"""`python -m enhsim_tf.reproduce`: runs the pipeline of the paper, draws its figures and prints a verdict for each claim."""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.noise.rung_names import BY_OPTION

if TYPE_CHECKING:
    from enhsim_tf.reproduce.settings import Settings

EXAMPLES = """\
examples:
  python -m enhsim_tf.reproduce                      everything at full budget, about four minutes on two cores
  python -m enhsim_tf.reproduce --budget smoke       every step with small counts, in less than a minute, written to smoke/
  python -m enhsim_tf.reproduce --only fig04         one figure and the stages that it needs
  python -m enhsim_tf.reproduce --telemetry my.csv --column volts --time utc --out my_figures
  python -m enhsim_tf.reproduce --store influxdb     with the server given by INFLUXDB_V2_URL, _TOKEN and _ORG
  python -m enhsim_tf.reproduce --experiment robustness
                                                     effect of each kind of noise on detectors; takes hours, can be interrupted
  python -m enhsim_tf.reproduce --experiment factorial
                                                     which part of the pipeline lowers false alarms; takes hours, can be interrupted
  python -m enhsim_tf.reproduce --experiment learning-curve
                                                     from how few real windows a simulator pays; an hour or two, can be interrupted
  python -m enhsim_tf.reproduce --experiment labelled --data DIR
                                                     detectors on real telemetry with labelled anomalies; some minutes per channel
  python -m enhsim_tf.reproduce --experiment battery
                                                     a coarse and a fine simulator of a battery (PyBaMM); some minutes per seed

exit code: 0 every claim has its expected verdict, 1 at least one claim has another verdict, 2 the input or an option cannot be used
"""


NOISES = ("white", "autoregressive", "heteroscedastic", "shot")
FAMILIES = (
    *NOISES, "fractional", "bernoulli", "one_over_f", "interference", "telegraph", "quantised", "bursts", "heavy_tails", "loudness",
    "signal_dependent",
)  # fmt: skip
EXPERIMENTS = {
    "robustness": "run_experiment",
    "factorial": "run_factorial",
    "noise": "run_noise",
    "learning-curve": "run_learning_curve",
    "labelled": "run_labelled",
    "battery": "run_battery",
}
WITH_FAMILIES = ("noise", "learning-curve")  # experiments for all families of noise; they take --rungs, too
WITH_ENVIRONMENTS = ("robustness", "factorial", *WITH_FAMILIES)
RUNG_NAMES = tuple(BY_OPTION.values())


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Reads the command line without slow imports.

    Raises:
        InputError: If an option is unknown or its value has the wrong type.
    """
    parser = Parser(
        prog="python -m enhsim_tf.reproduce",
        description="Reproduces Feldman 2020, 'Training robust anomaly detection using ML-Enhanced simulations', end to end.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--budget",
        choices=("smoke", "full"),
        default="full",
        help="size of the run: numbers of windows, epochs and iterations (default: full)",
    )
    parser.add_argument("--telemetry", type=Path, metavar="PATH", help="run the pipeline on a real channel: .npy, .csv or .parquet")
    parser.add_argument("--column", help="column with the values: a number for .npy, otherwise a name")
    parser.add_argument("--time", help="column with the timestamps (default: samples are numbered)")
    parser.add_argument(
        "--store",
        default="parquet",
        metavar="STORE",
        help="where the telemetry is stored and read back from: parquet (default), influxdb, or influxdb://bucket/measurement/field",
    )
    parser.add_argument("--only", metavar="FIGURE", help="draw one figure, for example fig04, and evaluate no claim")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random draws (default: 0)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder for figures and results.json (default: figures; separate folders for smoke runs, channels and partial experiments)",
    )
    parser.add_argument(
        "--spread", type=int, default=0, metavar="N", help="evaluate the claims for N further seeds and write the ranges to spread.json"
    )
    parser.add_argument(
        "--experiment",
        choices=EXPERIMENTS,
        help="run an experiment instead of the paper: robustness trains detectors with each kind of noise; factorial combines windows, extraction, enhancer and "
        "generator; noise tries noise models on fourteen families of noise; learning-curve varies the number of real windows; labelled tests "
        "detectors on real telemetry with labelled anomalies; battery enhances a coarse simulator of a battery with the help of a fine one",
    )
    parser.add_argument(
        "--data", type=Path, metavar="DIR", help="folder of labelled telemetry, with train/, test/ and labeled_anomalies.csv"
    )
    parser.add_argument("--channels", metavar="A,B", help="only these channels (default: all)")
    parser.add_argument("--environment", choices=FAMILIES, help="run the experiment with this kind of noise only (default: all)")
    parser.add_argument("--seeds", type=int, metavar="N", help="number of seeds of the experiment (default: 10, factorial: 5)")
    parser.add_argument(
        "--rungs",
        metavar="A,B",
        help="noise models: only these in the experiment on noise (default: all); also these in learning-curve (default: no networks)",
    )
    parser.add_argument("--arrays", action="store_true", help="also save the arrays behind each figure, as .npz")
    parser.add_argument("--fresh", action="store_true", help="run every stage again instead of using the cache")
    parser.add_argument("--cache", type=Path, metavar="DIR", help="folder of cached stages (default: .cache in a checkout)")
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Runs what the options ask for, and returns the exit code."""
    check(options)
    folder = make_folders(options)
    if options.experiment:
        runs = (run_robustness, run_factorial, run_noise, run_learning_curve, run_labelled, run_battery)
        return dict(zip(EXPERIMENTS, runs, strict=True))[options.experiment](options, folder)
    from enhsim_tf.common.atomic_files import write_json
    from enhsim_tf.reproduce.caption import figure_caption
    from enhsim_tf.reproduce.figure import save
    from enhsim_tf.reproduce.paper.claims import CLAIMS, changed, judge
    from enhsim_tf.reproduce.paper.data import Source
    from enhsim_tf.reproduce.paper.figures import FIGURES
    from enhsim_tf.reproduce.paper.over_seeds import ranges
    from enhsim_tf.reproduce.paper.pipeline import Experiment
    from enhsim_tf.reproduce.publish.page import write_page
    from enhsim_tf.reproduce.publish.results import fill_results, results, table
    from enhsim_tf.reproduce.publish.verdicts import BEFORE, PATH, fill_verdicts
    from enhsim_tf.reproduce.settings import make_settings
    from enhsim_tf.reproduce.stages import Stages, default_cache, save_arrays

    def make_experiment(seed: int) -> Experiment:
        is_terminal = sys.stdout.isatty()
        stages = Stages(options.cache or default_cache(), options.fresh, tell, speaks=not is_terminal)
        given = make_settings(options.budget, seed), stages, source, int(is_terminal)
        if options.store == "parquet":
            return Experiment(*given)
        from enhsim_tf.reproduce.paper.influx_pipeline import InfluxExperiment

        return InfluxExperiment(influx_location(options.store), *given)

    began, is_smoke = time.perf_counter(), options.budget == "smoke"
    source = None if options.telemetry is None else Source(options.telemetry, options.column, options.time)
    experiment = make_experiment(options.seed)

    def draw(names: Sequence[str]) -> float:
        """Draws figures and returns the time of the drawing alone, in seconds."""
        drawn_s = 0.0
        for name in names:
            data = FIGURES[name].arrays(experiment)  # runs the stages that the figure needs; these report their own time
            drawing = time.perf_counter()
            save(name, data, folder, figure_caption(name, experiment), is_smoke, figures=FIGURES)
            drawn_s += time.perf_counter() - drawing
            if options.arrays:
                save_arrays(folder, data, name)
        return drawn_s

    chosen, records, drawn_s = chosen_figures(options.only), [], 0.0
    early = [] if options.only else [name for name in chosen if not FIGURES[name].needs_training]
    if early:  # drawn first, before the minutes of training
        drawn_s += draw(early)
        tell(f"figures {figure_numbers(early)} drawn in {folder}/ before any training")
    if not options.only:
        records = judge(CLAIMS, experiment)
    drawn_s += draw([name for name in chosen if name not in early])
    tell(f"{'figures':12} {drawn_s:7.1f} s")
    if options.only:
        tell(f"{folder / chosen[0]}.png and .svg")
        return 0

    found = results(experiment, records, drawn_s, time.perf_counter() - began)
    write_json(folder / "results.json", found)
    tell(f"\n{table(records)}\n")
    tell(f"{found['verdict']}  {len(chosen)} figures and results.json in {folder}/; {found['this_run_s']:.0f} s in all")
    if options.spread:
        others = range(options.seed + 1, options.seed + 1 + options.spread)
        more = {seed: judge(CLAIMS, make_experiment(seed)) for seed in others}
        write_json(folder / "spread.json", ranges({options.seed: records} | more, options.budget))
        tell(f"ranges over seeds {options.seed} to {others[-1]} in {folder}/spread.json")
    tell(f"the whole run on one page: {write_page(folder, found, chosen)}")
    if is_smoke or source is not None:
        tell("A smoke run and a channel of one's own have no expected verdicts; those above are of this run alone.")
        return 0
    if folder == Path("figures"):
        fill_results(Path(), folder)
        fill_verdicts(PATH, BEFORE, folder)
    different = changed(records)
    if different:
        tell(f"Verdicts that changed: {', '.join(different)}")
    return 1 if different else 0


def run_robustness(options: argparse.Namespace, folder: Path) -> int:
    """Runs the experiment on robustness in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.publish.report import report, verdict_lines
    from enhsim_tf.reproduce.robustness.run import FOLDER, run

    found = run(*seeded(options, "robustness"), folder / FOLDER, environments_of(options), options.fresh, tell)
    return conclude(options, folder / FOLDER, ["", *verdict_lines(found)], lambda: report(found, Path()))


def run_noise(options: argparse.Namespace, folder: Path) -> int:
    """Runs the experiment on noise in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.noise_gallery import GALLERY
    from enhsim_tf.reproduce.noise_ladder.page import PAGE, fill_page
    from enhsim_tf.reproduce.noise_ladder.run import FOLDER, lines, run

    rungs = tuple(RUNG_NAMES) if options.rungs is None else chosen_rungs(options.rungs)
    found = run(*seeded(options, "ladder"), folder / FOLDER, environments_of(options, tuple(GALLERY)), rungs, options.fresh, tell)
    return conclude(options, folder / FOLDER, lines(found), lambda: fill_page(PAGE, noise=found))


def run_learning_curve(options: argparse.Namespace, folder: Path) -> int:
    """Runs the experiment on the number of real windows in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.learning_curve.run import FOLDER, lines, run
    from enhsim_tf.reproduce.noise_ladder.page import PAGE, fill_page

    rungs = () if options.rungs is None else chosen_rungs(options.rungs)
    found = run(*seeded(options, "curve"), folder / FOLDER, environments_of(options), rungs, options.fresh, tell)
    return conclude(options, folder / FOLDER, lines(found), lambda: fill_page(PAGE, curve=found))


def run_factorial(options: argparse.Namespace, folder: Path) -> int:
    """Runs the factorial experiment in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.factorial.run import FOLDER, run
    from enhsim_tf.reproduce.publish.factorial_text import lines

    found = run(*seeded(options, "factorial"), folder / FOLDER, environments_of(options), options.fresh, tell)
    return conclude(options, folder / FOLDER, ["", *lines(found)], write_report)


def seeded(options: argparse.Namespace, group: str) -> "tuple[Settings, Path]":
    """The settings, with the number of seeds of a group that `--seeds` asks for, and the cache."""
    from enhsim_tf.reproduce.settings import make_settings
    from enhsim_tf.reproduce.stages import default_cache

    turned = {} if options.seeds is None else {f"{group}__num_seeds": options.seeds}
    return make_settings(options.budget, **turned), options.cache or default_cache()


def environments_of(options: argparse.Namespace, every: tuple[str, ...] = NOISES) -> tuple[str, ...]:
    """The kinds of noise that `--environment` asks for."""
    return every if options.environment is None else (options.environment,)


def conclude(options: argparse.Namespace, out: Path, lines: Sequence[str], publish: Callable[[], Any], is_whole: bool | None = None) -> int:
    """Prints what an experiment found, and updates the documents if it is the published one; returns the exit code.

    Args:
        options: The options.
        out: The output folder of the experiment.
        lines: What it found.
        publish: Updates the documents.
        is_whole: Whether all parts of the published experiment were run; None looks at the options.
    """
    tell("\n".join(lines))
    if is_published(options, out, not is_other(options) if is_whole is None else is_whole):
        publish()
    tell(f"tables, findings.json and figures in {out}/")
    return 0


def write_report() -> None:
    """Writes the report again, if there are findings of the experiment on robustness."""
    from enhsim_tf.reproduce.publish.report import findings_of, report

    kept = findings_of(Path(), "robustness")
    if kept is not None:
        report(kept, Path())


def chosen_rungs(given: str) -> tuple[str, ...]:
    """Reads `--rungs`, in the order of the ladder."""
    from enhsim_tf.common.errors import InputError

    names = [name.strip() for name in given.split(",")]
    unknown = [name for name in names if name not in RUNG_NAMES]
    if unknown:
        raise InputError(f"Expected --rungs of {', '.join(RUNG_NAMES)}. Received: {unknown[0]!r}.")
    return tuple(name for name in RUNG_NAMES if name in names)


def run_labelled(options: argparse.Namespace, folder: Path) -> int:
    """Runs the study of real telemetry in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.spacecraft.run import FOLDER, lines, run

    chosen = None if options.channels is None else [name.strip() for name in options.channels.split(",")]
    is_whole = not is_other(options)  # looked up before the run overwrites the published results
    settings, cache = seeded(options, "labelled")
    found = run(settings, cache, options.data, folder / FOLDER, chosen, options.fresh, tell)
    return conclude(options, folder / FOLDER, ["", *lines(found)], write_report, is_whole)


def run_battery(options: argparse.Namespace, folder: Path) -> int:
    """Runs the study of a pair of battery simulators in a subfolder of the figures' folder, and returns the exit code."""
    from enhsim_tf.reproduce.battery.simulate import check_installed

    check_installed()
    from enhsim_tf.reproduce.battery.findings import lines
    from enhsim_tf.reproduce.battery.page import fill_page
    from enhsim_tf.reproduce.battery.run import FOLDER, run

    found = run(*seeded(options, "battery"), folder / FOLDER, options.fresh, tell)
    return conclude(options, folder / FOLDER, ["", *lines(found)], lambda: fill_page(Path(), found))


def check(options: argparse.Namespace) -> None:
    """Rejects options that cannot be used, before anything is computed and without importing TensorFlow."""
    from enhsim_tf.common.errors import InputError

    if not 0 <= options.seed < 2**32 - max(options.spread, 0):
        raise InputError(f"Expected a seed from 0 to before 2**32, with the further ones. Received: --seed {options.seed}.")
    if options.spread < 0:
        raise InputError(f"Expected a number of further seeds. Received: --spread {options.spread}.")
    chosen_figures(options.only)
    for name, experiments in (("environment", WITH_ENVIRONMENTS), ("seeds", (*WITH_ENVIRONMENTS, "battery"))):
        if getattr(options, name) is not None and options.experiment not in experiments:
            raise InputError(f"Expected --{name} together with --experiment {' or '.join(experiments)}. Received: --{name} without it.")
    if (options.experiment == "labelled") != (options.data is not None) or (options.channels and options.data is None):
        raise InputError("Expected --experiment labelled and --data DIR together, and --channels only with them. Received: one alone.")
    if options.data is not None:
        from enhsim_tf.telemetry.telemanom import read_labels

        read_labels(options.data)
    if options.experiment and (options.only or options.telemetry or options.spread or options.seed or options.arrays):
        raise InputError(
            "Expected --experiment without --only, --telemetry, --spread, --seed and --arrays: its seeds are its own. Received: one of them."
        )
    if options.experiment and options.store != "parquet":
        raise InputError(f"Expected --experiment with the Parquet store. Received: --store {options.store}.")
    if options.rungs is not None:
        if options.experiment not in WITH_FAMILIES:
            raise InputError(f"Expected --rungs together with --experiment {' or '.join(WITH_FAMILIES)}. Received: --rungs without it.")
        chosen_rungs(options.rungs)
    if options.experiment not in WITH_FAMILIES and options.environment not in (None, *NOISES):
        raise InputError(f"Expected --environment {', '.join(NOISES)} with this experiment. Received: {options.environment}.")
    if options.seeds is not None and options.seeds < 1:
        raise InputError(f"Expected at least one seed. Received: --seeds {options.seeds}.")
    for name in ("column", "time"):
        if getattr(options, name) is not None and options.telemetry is None:
            raise InputError(f"Expected --{name} together with --telemetry. Received: --{name} alone.")
    if options.budget == "smoke" and out_folder(options).resolve() == Path("figures").resolve():
        raise InputError("Expected another --out for a smoke run: figures/ holds full budget. Received: --out figures.")
    if options.store != "parquet":
        from enhsim_tf.telemetry.influx_store import InfluxStore

        InfluxStore(influx_location(options.store)).check()
    if options.telemetry is not None:
        from enhsim_tf.reproduce.paper.data import least_part
        from enhsim_tf.reproduce.settings import Settings
        from enhsim_tf.telemetry.sources import read_telemetry

        read_telemetry(options.telemetry, options.column, options.time, 2 * least_part(Settings()))


def influx_location(place: str) -> str:
    """The location in InfluxDB to which `--store` writes the telemetry."""
    from enhsim_tf.common.errors import InputError
    from enhsim_tf.reproduce.settings import LOCATION

    if place != "influxdb" and not place.startswith("influxdb://"):
        raise InputError(f"Expected --store parquet, influxdb or influxdb://bucket/measurement/field. Received: --store {place}.")
    return LOCATION if place == "influxdb" else place


def chosen_figures(only: str | None) -> list[str]:
    """Names of the figures to draw: all, or the one given by its number or full name."""
    from enhsim_tf.common.errors import InputError
    from enhsim_tf.reproduce.paper.figures import FIGURES

    chosen = [name for name in FIGURES if only is None or only in (name, name.split("_")[0])]
    if not chosen:
        raise InputError(f"Expected --only with one of {', '.join(name.split('_')[0] for name in FIGURES)}. Received: {only!r}.")
    return chosen


def figure_numbers(names: Sequence[str]) -> str:
    """Numbers of figures as text, such as `2, 3 and 11`."""
    *numbers, last = [str(int(name.removeprefix("fig")[:2])) for name in names]
    return f"{', '.join(numbers)} and {last}" if numbers else last


def out_folder(options: argparse.Namespace) -> Path:
    """The output folder. Smoke runs, real channels and partial experiments have separate folders."""
    default = "smoke" if options.budget == "smoke" else "figures"
    if options.telemetry is not None:
        default = f"{default}_{options.telemetry.stem}"
    elif is_other(options):
        default = f"{default}_{'part' if options.data is None else options.data.resolve().name}"
    return options.out or Path(default)


def is_other(options: argparse.Namespace) -> bool:
    """Whether the experiment differs from the published one: fewer seeds, a single environment or other channels."""
    if options.experiment != "labelled":
        return options.seeds is not None or options.environment is not None
    from enhsim_tf.reproduce.publish.report import findings_of
    from enhsim_tf.telemetry.telemanom import read_labels

    shown = findings_of(Path(), "labelled")
    return bool(options.channels) or (shown is not None and set(read_labels(options.data)) != {*shown["channels"], *shown["skipped"]})


def is_published(options: argparse.Namespace, out: Path, is_whole: bool) -> bool:
    """Whether a run is the published one of its experiment: full budget, all of its parts, in a subfolder of `figures`."""
    return options.budget == "full" and out.parent == Path("figures") and options.rungs is None and is_whole


def make_folders(options: argparse.Namespace) -> Path:
    """Creates the folders that the options name, before any slow import, and returns the folder of the figures."""
    from enhsim_tf.common.atomic_files import make_folder, remove_leftovers

    out = make_folder(out_folder(options))
    remove_leftovers(out)
    if options.cache is not None:
        make_folder(options.cache)
    return out


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""
    return run_command(lambda: run(parse(arguments)), "interrupted; finished stages are kept, the next run goes on behind them")


if __name__ == "__main__":
    sys.exit(main())
