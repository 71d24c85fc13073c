"""The command: runs the pipeline of the paper, draws its figures, and gives a verdict on each of
its claims.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.common.atomic_files import (
    make_folder,
    remove_leftovers,
    removing_empty,
    write_json,
)
from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.common.stages import Stages, default_cache

if TYPE_CHECKING:
    from enhsim_tf.paper.settings import Settings

PROGRAM = "python -m enhsim_tf.reproduce"
EXAMPLES = f"""\
examples:
  {PROGRAM}                            everything at full budget, in minutes
  {PROGRAM} --budget smoke             every step with small counts, written to smoke/
  {PROGRAM} --only fig04               one figure and the stages that it needs
  {PROGRAM} --set dropout=0            another reading; the decisions page lists all settings
  {PROGRAM} --telemetry my.csv --column volts --time utc --out my_figures
  {PROGRAM} --store influxdb           with the server given by INFLUXDB_V2_URL, _TOKEN and _ORG

further experiments are studies with commands of their own: python -m studies.robustness and others

exit code: 0 every measurement with a limit lies within its published range, 1 one does not,
2 an input or option cannot be used
"""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Reads the command line without slow imports."""
    parser = Parser(
        prog=PROGRAM,
        description="Reproduces Feldman 2020, end to end.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--budget",
        choices=("smoke", "full"),
        default="full",
        help="size of the run (default: full)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of all random draws (default: 0)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="changes a setting; may be repeated",
    )
    parser.add_argument(
        "--only",
        choices=[f"fig{number:02}" for number in range(1, 15)],
        metavar="FIGURE",
        help="draws one figure, for example fig04, and evaluates no claim",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (default: figures; another one for other runs than the published)",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="folder of finished stages (default: .cache, or ENHSIM_TF_CACHE)",
    )
    parser.add_argument("--fresh", action="store_true", help="makes all stages again")
    parser.add_argument(
        "--telemetry",
        type=Path,
        metavar="PATH",
        help="runs the pipeline on a real channel: .npy, .csv or .parquet",
    )
    parser.add_argument("--column", help="its column with the values")
    parser.add_argument("--time", help="its column with the timestamps")
    parser.add_argument(
        "--store",
        default="parquet",
        metavar="STORE",
        help="parquet, influxdb, or influxdb://bucket/measurement/field",
    )
    return parser.parse_args(arguments)


def read_settings(options: argparse.Namespace) -> "Settings":
    """The settings that the options ask for."""
    from enhsim_tf.paper.settings import make_settings

    pairs = [text.partition("=") for text in options.set]
    if wrong := [name for name, equals, value in pairs if not (equals and value)]:
        raise InputError(f"Expected --set NAME=VALUE. Received: --set {wrong[0]}.")
    if named := {"seed", "budget"}.intersection(name for name, *_ in pairs):
        raise InputError(f"Expected --{min(named)}. Received: --set {min(named)}. Give the option.")
    return make_settings(
        options.budget, seed=options.seed, **{name: value for name, _, value in pairs}
    )


def choose_folder(options: argparse.Namespace) -> Path:
    """The output folder. Only a run of the reference on the example with seed 0 writes to `figures`
    of its own accord.
    """
    default = "smoke" if options.budget == "smoke" else "figures"
    if options.telemetry is not None:
        default = f"{default}_{options.telemetry.stem}"
    elif options.set:
        default = f"{default}_changed"
    elif options.seed:
        default = f"{default}_seed{options.seed}"
    if (
        options.out is not None
        and options.budget == "smoke"
        and options.out.resolve() == Path("figures").resolve()
    ):
        raise InputError(
            "Expected another --out for a smoke run: figures/ holds full budget. Received: --out "
            "figures."
        )
    return options.out or Path(default)


def run(options: argparse.Namespace) -> int:
    """Runs the command and returns its exit code."""
    began = time.perf_counter()
    if options.telemetry is None and (options.column or options.time):
        raise InputError(
            "Expected --column and --time together with --telemetry. Received: one of them alone."
        )
    settings = read_settings(options)
    folder = choose_folder(options)
    store = None
    if options.store != "parquet":
        from enhsim_tf.own_store import InfluxTelemetry

        store = InfluxTelemetry(options.store)
    make_folder(folder)
    cache = make_folder(options.cache or default_cache())
    remove_leftovers(folder)

    # the seconds of TensorFlow begin here, after all cheap checks
    from enhsim_tf.paper.claims import judge_all, outside, title
    from enhsim_tf.paper.figures import FIGURES, TRAINED, save_figure
    from enhsim_tf.paper.pipeline import Pipeline
    from enhsim_tf.paper.report import as_text, read_published, results, write_page

    stages = Stages(cache, options.fresh, tell, speaks=True)
    if options.telemetry is None:
        pipeline = Pipeline(settings, stages, store)
    else:
        from enhsim_tf.own_channel import OwnChannel

        pipeline = OwnChannel(
            settings, stages, store, options.telemetry, options.column, options.time
        )
    for name in sorted(FIGURES, key=lambda name: name[:5] in TRAINED):
        if options.only in (None, name[:5]):
            save_figure(name, pipeline, folder, foot_of(options, name), options.budget == "smoke")
    if options.only:
        return 0

    records = judge_all(pipeline)
    published = read_published()
    about = {
        "budget": options.budget,
        "seconds": time.perf_counter() - began,
        "stages": stages.seconds,
        "from_cache": [name for name, kept in stages.cached.items() if kept],
    }
    found = results(
        records,
        title([record["verdict"] for record in records if record["is_tested"]]),
        settings,
        published,
        **about,
    )
    write_json(folder / "results.json", found)
    tell(f"\n{as_text(found['box'])}\n")
    tell(
        f"published {published['title']} (in brackets: runs reproduced/partly/not)   this run "
        f"{found['title']}   {about['seconds']:.0f} s"
    )
    tell(
        "figures, results.json and the whole run on one page: "
        f"{write_page(folder, found, settings)}"
    )
    return conclude(options, outside(records, published))


def foot_of(options: argparse.Namespace, figure: str) -> str:
    """The foot of a figure: what this run differs in from others, and the command for this
    figure.
    """
    source = [] if options.telemetry is None else [options.telemetry.name]
    store = [] if options.store == "parquet" else [f"store {options.store}"]
    about = [
        f"seed {options.seed}",
        f"{options.budget} budget",
        *options.set,
        *source,
        *store,
        f"{PROGRAM} --only {figure.split('_')[0]}",
    ]
    return printable(" · ".join(about))


def conclude(options: argparse.Namespace, different: list[str]) -> int:
    """Tells how the measurements compare with the published ranges, and returns the exit code."""
    if options.budget == "smoke" or options.telemetry or options.set:
        tell(
            "Published verdicts are those of the reference on the paper's example at full budget; "
            "this run is another one."
        )
        return 0
    for line in different:
        tell(f"outside the published range: {line}")
    return 1 if different else 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""

    def run_parsed() -> int:
        options = parse(arguments)
        with removing_empty(choose_folder(options), options.cache):
            return run(options)

    return run_command(
        run_parsed, "interrupted; finished stages are kept, and the next run continues after them"
    )


if __name__ == "__main__":
    sys.exit(main())
