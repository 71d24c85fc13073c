"""The command `python -m benchmarks`: runs the benchmarks, prints a table, writes `results.json` and draws two figures."""

import argparse
import dataclasses
import json
import sys
import time
from pathlib import Path

ROWS = ("enhancer", "gan", "second", "generation", "loading", "starting", "growth", "reproduce")
FOLDER = Path(__file__).parent
RESULTS = ("results.json", "results_avx2.json")
"""Names of the result files: with all instructions of the processor, and without AVX-512."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Parses the options of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Speed of enhsim_tf, compared with other implementations and with the limits of the machine.",
    )
    parser.add_argument("--quick", action="store_true", help="tiny networks, few repetitions: shows that everything runs, measures nothing")
    parser.add_argument("--only", choices=ROWS, action="append", help="measure these rows alone; others stay as they are in the file")
    parser.add_argument(
        "--avx2",
        action="store_true",
        help="compute as a processor without AVX-512 does, and compare with what plain Keras is there; into results_avx2.json",
    )
    parser.add_argument("--redraw", action="store_true", help="measure nothing: figures and table anew from the results that are there")
    parser.add_argument("--repetitions", type=int, help="of each comparison, instead of the budget's 7")
    parser.add_argument("--out", type=Path, help="the results (default: results.json or results_avx2.json beside this program)")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder of the figures (default: %(default)s)")
    options = parser.parse_args(arguments)
    if options.quick and options.out is None:
        parser.error("--quick needs another --out: results.json holds measurements")
    if options.repetitions is not None and options.repetitions < 1:
        parser.error(f"--repetitions must be 1 or more, not {options.repetitions}")
    options.out = options.out or FOLDER / RESULTS[options.avx2]
    if options.redraw and (options.quick or options.only or options.repetitions):
        parser.error("--redraw measures nothing: leave out --quick, --only and --repetitions")
    if options.redraw and not options.out.is_file():
        parser.error(f"--redraw needs the results of a run, and {options.out} is none")
    return options


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    options = parse(arguments)
    from benchmarks.figures import draw
    from benchmarks.report import fill_page, with_words
    from enhsim_tf.common.atomic_files import write_json

    if options.redraw:
        kept = json.loads(options.out.read_text())
        made = kept | {"rows": with_words(kept)}
    else:
        made = measure(options)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_json(options.out, made)
    drawn = [] if options.avx2 else draw(made, options.figures)
    for file in [options.out, *drawn]:
        print(file)
    if options.out == FOLDER / RESULTS[options.avx2]:
        fill_page(FOLDER.parent, [json.loads((FOLDER / name).read_text()) for name in RESULTS if (FOLDER / name).is_file()])
    return 0


def measure(options: argparse.Namespace) -> dict:
    """Runs the selected benchmarks, prints each row, and returns the content of `results.json`."""
    from benchmarks import rows as benchmark_rows
    from benchmarks.machine import AVX2, PLAIN_KERNELS, machine
    from benchmarks.report import line_of
    from benchmarks.worker import Worker

    if options.avx2:
        Worker.processor, Worker.of_comparisons = AVX2, PLAIN_KERNELS
    budget, began = benchmark_rows.QUICK if options.quick else benchmark_rows.Budget(), time.time()
    if options.repetitions:
        budget = dataclasses.replace(budget, repetitions=options.repetitions)
    this = machine() | {"as_without_avx512": options.avx2}
    kept = json.loads(options.out.read_text()) if options.only and options.out.exists() else {"machine": this, "rows": []}
    about = kept["machine"]
    # a row of another processor than the rest says so; processors of one name can differ in their instruction sets
    is_same = all(this[key] == about[key] for key in ("processor", "instruction_sets"))
    elsewhere = {} if is_same else {"machine": this}
    found = []
    for name in ROWS:
        if options.only and name not in options.only:
            found += [row for row in kept["rows"] if row.get("of") == name]
            continue
        for row in benchmark_rows.ROWS[name](budget):
            found.append({"of": name, **row, **elsewhere})
            print(line_of(row), flush=True)
    for row in benchmark_rows.reproduction(found, benchmark_rows.bar_of_reproduction(about)):
        found.append({"of": "reproduction", **row})
        print(line_of(row), flush=True)
    return {"quick": options.quick, "minutes": round((time.time() - began) / 60, 1), "machine": about, "rows": found}


if __name__ == "__main__":
    sys.exit(main())
