"""The command that all studies share: `python -m studies.NAME`, its options, its folders and its
exit code.
"""

import argparse
import dataclasses
import importlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

PUBLISHED = Path(__file__).resolve().parents[1]


@dataclasses.dataclass(frozen=True)
class Command:
    """The command of a study.

    Args:
        study: Name of the study, of its folder and of its group of settings, whose `num_seeds` the
            option `--seeds` changes.
        description: What the study does, in a sentence.
        options: Further options: for each name what `argparse` takes beside it.
        environments: The kinds of noise of the study, of which `--environment` chooses one; the
            options hold those that are asked for as `environments`.
        tables_of: Computes the tables of one kind of noise and one seed; it takes the options, the
            settings, which hold both, and stages. None: `run` of `studies.STUDY.run` runs the
            study; it takes the options, the settings and the output folder.
    """

    study: str
    description: str
    options: Mapping[str, Mapping[str, Any]] = dataclasses.field(default_factory=dict)
    environments: Iterable[str] = ()
    tables_of: "Callable[[argparse.Namespace, Any, Any], Mapping[str, pd.DataFrame]] | None" = None

    def __call__(self, arguments: list[str] | None = None) -> int:
        """Runs the command. An error of the user is reported as one line, with exit code 2."""
        return run_command(
            lambda: self._run(self._parse(arguments)),
            "interrupted; finished stages are kept, the next run goes on behind them",
        )

    def _parse(self, arguments: list[str] | None) -> argparse.Namespace:
        """Reads the command line without slow imports."""
        parser = Parser(prog=f"python -m studies.{self.study}", description=self.description)
        own = PUBLISHED / self.study / "results"
        out_help = (
            f"output folder (default: results/{self.study}; the published tables are in "
            f"studies/{self.study}/results)"
        )
        add_budget_and_cache(parser)
        parser.add_argument(
            "--seeds",
            type=int,
            metavar="N",
            help="number of seeds (default: that of the published tables)",
        )
        parser.add_argument(
            "--out", type=Path, metavar="DIR", default=Path("results") / self.study, help=out_help
        )
        parser.add_argument(
            "--fresh", action="store_true", help="run every stage again instead of using the cache"
        )
        if self.environments:
            parser.add_argument(
                "--environment",
                choices=tuple(self.environments),
                help="run with this kind of noise only (default: all)",
            )
        for name, words in self.options.items():
            parser.add_argument(name, **words)
        options = parser.parse_args(arguments)
        if self.environments:
            chosen = options.environment
            options.environments = tuple(self.environments) if chosen is None else (chosen,)
        if options.seeds is not None and options.seeds < 1:
            raise InputError(f"Expected at least one seed. Received: --seeds {options.seeds}.")
        if options.budget == "smoke" and options.out.resolve() == own:
            raise InputError(
                "Expected another folder for a smoke run than that of the published tables. "
                f"Received: --out {options.out}."
            )
        return options

    def _run(self, options: argparse.Namespace) -> int:
        from enhsim_tf.common.atomic_files import make_folder, remove_leftovers
        from enhsim_tf.common.stages import default_cache
        from studies.common.settings import make_settings

        out = make_folder(options.out)
        remove_leftovers(out)
        options.cache = make_folder(options.cache or default_cache())
        turned = {} if options.seeds is None else {f"{self.study}__num_seeds": options.seeds}
        self.run(options, make_settings(options.budget, **turned), out)
        tell(f"tables, findings.json and figures in {out}/")
        return 0

    def run(self, options: argparse.Namespace, settings: Any, out: Path) -> dict[str, Any]:
        """Runs the study, writes to an existing folder and returns the findings."""
        if self.tables_of is None:
            return importlib.import_module(f"studies.{self.study}.run").run(options, settings, out)
        from studies.common.replicates import run_study

        def tables_of(environment: str, seed: int, stages: Any) -> "Mapping[str, pd.DataFrame]":
            return self.tables_of(options, settings.of(environment, seed), stages)

        return run_study(self.study, tables_of, options.environments, options, settings, out)


def add_budget_and_cache(parser: argparse.ArgumentParser) -> None:
    """Adds the options `--budget` and `--cache`, which every study has."""
    parser.add_argument(
        "--budget",
        choices=("smoke", "full"),
        default="full",
        help="size of the run (default: full, which takes hours)",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="folder of cached stages (default: .cache in a checkout)",
    )


def example_command(
    study: str,
    what: str,
    tables: "Callable[[], Mapping[str, pd.DataFrame]]",
    arguments: list[str] | None = None,
) -> int:
    """The command `python -m studies.STUDY.example`, which writes the recorded pair that ships with
    the project.

    Args:
        study: Name of the study.
        what: Of what the pair is, which is also the name of its folder in `examples`.
        tables: Simulates the tables of the pair by name.
        arguments: The command line; None: that of the process.

    Returns:
        The exit code. An error of the user is reported as one line, with exit code 2.
    """

    def run() -> int:
        from enhsim_tf.common.atomic_files import make_folder, replace_file

        parser = Parser(
            prog=f"python -m studies.{study}.example",
            description=f"Writes the recorded pair of the {what}.",
        )
        parser.add_argument("folder", type=Path, help=f"the output folder, such as examples/{what}")
        folder = make_folder(parser.parse_args(arguments).folder)
        for name, table in tables().items():
            with replace_file(folder / f"{name}.csv") as temporary:
                table.to_csv(temporary, index=False, lineterminator="\n")
        tell(f"telemetry and simulator with and without a fault in {folder}/")
        return 0

    return run_command(run, "interrupted; complete files are kept")
