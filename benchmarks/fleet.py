"""Speed of large data sets: `python -m benchmarks.fleet MODEL_DIR --out fleet.json`.

Windows a second of `local` with one and two workers and of `ray` with two, each as a whole (processes starting included)
and from the first shard on; bytes a window in the files; and the memory of the driver and of its largest worker. The rows
differ in nothing but who works: their checksums are compared.
"""

import argparse
import dataclasses
import importlib.util
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROWS = {"local, 1 worker": ("local", 1), "local, 2 workers": ("local", 2), "ray, 2 workers": ("ray", 2)}


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet", description="Speed of large data sets.")
    parser.add_argument("models", type=Path, metavar="MODEL_DIR", help="a saved simulator")
    parser.add_argument("--windows", type=int, default=100_000, metavar="N", help="windows of each row (default: 100000)")
    parser.add_argument("--repetitions", type=int, default=3, metavar="N", help="of each row, in turn (default: 3)")
    parser.add_argument("--nominal-share", type=float, default=0.5, metavar="SHARE", help="the others are stuck or drift (default: 0.5)")
    parser.add_argument("--out", type=Path, required=True, help="the results")
    parser.add_argument("--one", choices=ROWS, help=argparse.SUPPRESS)  # a row in a process of its own, whose memory is its own
    return parser.parse_args(arguments)


def measure_one(options: argparse.Namespace) -> dict:
    """Makes one data set and says what that took."""
    from enhsim_tf import engines, fleet
    from enhsim_tf.fleet_plan import plan_of
    from enhsim_tf.scenario_file import mix_of
    from enhsim_tf.simulator import Degraded

    engine, workers = ROWS[options.one]
    mix = mix_of([Degraded("stuck", 0.5), Degraded("drift", 0.3)], options.nominal_share)
    plan = plan_of(dataclasses.replace(mix, shard=min(8_192, max(1, options.windows // 8))), options.models, 0, options.windows)
    finished, run = [], engines.run

    def timed(*arguments):
        for record in run(*arguments):
            finished.append((time.perf_counter(), record.rows))
            yield record

    engines.run = timed
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        fleet.generate_fleet(Path(folder) / "set", plan, workers, engine, tell=lambda line: None)
        seconds = time.perf_counter() - began
        files = list((Path(folder) / "set").glob("shard-*.parquet"))
        num_bytes = sum(file.stat().st_size for file in files)
        checksums = fleet.read_manifest(Path(folder) / "set")["shards"]
    later = sum(rows for _, rows in finished[workers:])
    return {
        "windows": options.windows,
        "samples": plan.window,
        "seconds": seconds,
        "windows_a_second": options.windows / seconds,
        # the workers' first shards wait for TensorFlow and for the networks to be built
        "windows_a_second_once_running": later / (finished[-1][0] - finished[workers - 1][0]) if later else None,
        "bytes_a_window": num_bytes / options.windows,
        "driver_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        # of processes that have ended: with Ray those of its own making are none of ours
        "largest_worker_bytes": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 if engine == "local" else None,
        "sha256": [record.sha256 for record in checksums],
    }


def main(arguments: list[str] | None = None) -> int:
    """Measures every row and writes the results."""
    import json

    from enhsim_tf.files import write_json

    options = parse(arguments)
    if options.one:
        print(json.dumps(measure_one(options)))
        return 0
    names = [name for name in ROWS if "ray" not in name or importlib.util.find_spec("ray")]
    found: dict[str, list[dict]] = {name: [] for name in names}
    for _ in range(options.repetitions):
        for name in names:  # in turn: what else the machine does meets all rows alike
            given = [str(options.models), "--windows", str(options.windows), "--nominal-share", str(options.nominal_share), "--out", "-"]
            ended = subprocess.run([sys.executable, "-m", "benchmarks.fleet", *given, "--one", name], capture_output=True, text=True)
            if ended.returncode:
                raise SystemExit(f"{name}: {ended.stderr.strip().splitlines()[-1]}")
            found[name].append(json.loads(ended.stdout.splitlines()[-1]))
            print(f"{name:18} {found[name][-1]['windows_a_second']:10,.0f} windows a second", flush=True)
    same = len({json.dumps(row.pop("sha256")) for rows in found.values() for row in rows}) == 1
    write_json(options.out, {"same_bytes": same, "rows": found})
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
