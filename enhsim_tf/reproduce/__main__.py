"""`python -m enhsim_tf.reproduce`: runs the pipeline of the paper, draws its figures and prints a verdict for each claim."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from enhsim_tf.common.console import Parser, run_command, tell

EXAMPLES = """\
examples:
  python -m enhsim_tf.reproduce                      everything at full budget, minutes on two cores
  python -m enhsim_tf.reproduce --budget smoke       every step with small counts, in less than a minute, written to smoke/
  python -m enhsim_tf.reproduce --only fig04         one figure and the stages that it needs
  python -m enhsim_tf.reproduce --telemetry my.csv --column volts --time utc --out my_figures
  python -m enhsim_tf.reproduce --store influxdb     with the server given by INFLUXDB_V2_URL, _TOKEN and _ORG
  python -m studies.robustness                       a study beyond the paper; studies/README.md lists all of them

exit code: 0 every claim has its expected verdict, 1 at least one claim has another verdict, 2 the input or an option cannot be used
"""


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
        help="output folder for figures and results.json (default: figures; separate folders for smoke runs and channels)",
    )
    parser.add_argument(
        "--spread", type=int, default=0, metavar="N", help="evaluate the claims for N further seeds and write the ranges to spread.json"
    )
    parser.add_argument("--arrays", action="store_true", help="also save the arrays behind each figure, as .npz")
    parser.add_argument("--fresh", action="store_true", help="run every stage again instead of using the cache")
    parser.add_argument("--cache", type=Path, metavar="DIR", help="folder of cached stages (default: .cache in a checkout)")
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Runs what the options ask for, and returns the exit code."""
    check(options)
    folder = make_folders(options)
    from enhsim_tf.common.atomic_files import write_json
    from enhsim_tf.common.figure import save
    from enhsim_tf.common.stages import Stages, default_cache, save_arrays
    from enhsim_tf.reproduce.caption import figure_caption
    from enhsim_tf.reproduce.paper.claims import CLAIMS, changed, judge
    from enhsim_tf.reproduce.paper.data import Source
    from enhsim_tf.reproduce.paper.figures import FIGURES
    from enhsim_tf.reproduce.paper.over_seeds import ranges
    from enhsim_tf.reproduce.paper.pipeline import Experiment
    from enhsim_tf.reproduce.report import write_page
    from enhsim_tf.reproduce.results import results, table
    from enhsim_tf.reproduce.settings import make_settings

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
    different = changed(records)
    if different:
        tell(f"Verdicts that changed: {', '.join(different)}")
    return 1 if different else 0


def check(options: argparse.Namespace) -> None:
    """Rejects options that cannot be used, before anything is computed and without importing TensorFlow."""
    from enhsim_tf.common.errors import InputError

    if not 0 <= options.seed < 2**32 - max(options.spread, 0):
        raise InputError(f"Expected a seed from 0 to before 2**32, with the further ones. Received: --seed {options.seed}.")
    if options.spread < 0:
        raise InputError(f"Expected a number of further seeds. Received: --spread {options.spread}.")
    chosen_figures(options.only)
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
    """The output folder. Smoke runs and real channels have separate folders."""
    default = "smoke" if options.budget == "smoke" else "figures"
    if options.telemetry is not None:
        default = f"{default}_{options.telemetry.stem}"
    return options.out or Path(default)


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
