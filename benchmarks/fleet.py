"""Speed of large data sets: `python -m benchmarks.fleet MODEL_DIR`.

The benchmark measures the engine `local` with one and two workers, and the engine `ray` with two workers. For each, it reports
the number of windows in a second, both for the whole run (including the start of processes) and after the first shards, the
size of the files, and the memory of the driver and of the largest worker. It also reports how a worker's time is distributed,
and how many shards a driver could distribute in a second. All rows generate the same data set, which is verified by checksums.
`benchmarks.sizing` draws the results and projects them to clusters.
"""

import argparse
import dataclasses
import importlib.util
import json
import operator
import pickle
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enhsim_tf.datasets.plan import Plan

ROWS = {"local, 1 worker": ("local", 1), "local, 2 workers": ("local", 2), "ray, 2 workers": ("ray", 2)}
PARTS, IDLE = "where the time goes", {"a driver alone, local": ("local", 2), "a driver alone, ray": ("ray", 2)}
_NUM_IDLE = 5_000  # number of tasks without any work


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parses the options of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet", description="Speed of large data sets.")
    parser.add_argument("models", type=Path, metavar="MODEL_DIR", help="a saved simulator")
    parser.add_argument("--windows", type=int, default=200_000, metavar="N", help="windows of each row (default: 200000)")
    parser.add_argument("--repetitions", type=int, default=3, metavar="N", help="of each row, in turn (default: 3)")
    parser.add_argument(
        "--large", type=int, default=1_000_000, metavar="N", help="windows of one more, with two workers (default: 1000000)"
    )
    parser.add_argument("--nominal-share", type=float, default=0.5, metavar="SHARE", help="the others are stuck or drift (default: 0.5)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "fleet.json", help="the results (default: %(default)s)")
    parser.add_argument(
        "--one", choices=[*ROWS, PARTS, *IDLE], help=argparse.SUPPRESS
    )  # measured in a separate process, so that its memory is its own
    return parser.parse_args(arguments)


def plan_for(options: argparse.Namespace) -> "Plan":
    """Returns the plan of the data set, which is the same for all rows."""
    from enhsim_tf.coarse_simulator.degraded import Degraded
    from enhsim_tf.datasets.mix import make_mix
    from enhsim_tf.datasets.plan import make_plan

    mix = make_mix([Degraded("stuck", 0.5), Degraded("drift", 0.3)], options.nominal_share)
    mix = dataclasses.replace(mix, shard=min(8_192, max(1, options.windows // 8)))
    return make_plan(mix, options.models, 0, options.windows)


def measure_row(options: argparse.Namespace) -> dict:
    """Generates one data set, and returns the time and the memory that this took."""
    from enhsim_tf.common.parallel import engines
    from enhsim_tf.datasets import generate

    engine, workers = ROWS[options.one]
    plan, run, finished, actor_bytes = plan_for(options), engines.run, [], []

    def timed(*arguments):
        for record in run(*arguments):
            finished.append((time.perf_counter(), record.rows))
            actor_bytes.append(_largest_actor())
            yield record

    engines.run = timed
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        generate.generate_data_set(Path(folder) / "set", plan, workers, engine, tell=lambda line: None)
        seconds = time.perf_counter() - began
        num_bytes = sum(file.stat().st_size for file in (Path(folder) / "set").glob("shard-*.parquet"))
        checksums = generate.read_manifest(Path(folder) / "set")["shards"]
    later = sum(rows for _, rows in finished[workers:])
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    return {
        "windows": options.windows,
        "samples": plan.window,
        "shard": plan.shard,
        "seconds": seconds,
        "windows_a_second": options.windows / seconds,
        "first_shard_s": finished[0][0] - began,
        # the workers' first shards wait for TensorFlow and for the networks to be built
        "windows_a_second_once_running": later / (finished[-1][0] - finished[workers - 1][0]) if later else None,
        "bytes_a_window": num_bytes / options.windows,
        "driver_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "largest_worker_bytes": children if engine == "local" else max(actor_bytes),
        "sha256": [record.sha256 for record in checksums],
    }


def _largest_actor() -> int:
    """Returns the peak memory of the largest Ray actor on this machine, in bytes. Actors are not child processes of this one."""
    most = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cmdline").read_bytes().startswith(b"ray::_Actor"):
                lines = (process / "status").read_text().splitlines()
                most = max(most, *(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")))
        except OSError:  # the process has ended
            continue
    return most


def measure_parts(options: argparse.Namespace) -> dict:
    """Generates shards in this process, with one thread like a worker, and returns the time for each part of the work."""
    from enhsim_tf.common.parallel import local
    from enhsim_tf.datasets import shard

    local.start_worker(pickle.dumps(None), threads=1)

    plan = plan_for(options)
    num_shards = min(plan.num_shards - 1, 6)
    spent: dict[str, float] = {}

    def timed(name: str, call: Callable) -> Callable:
        def wrapped(*arguments, **named):
            began = time.perf_counter()
            try:
                return call(*arguments, **named)
            finally:
                spent[name] = spent.get(name, 0.0) + time.perf_counter() - began

        return wrapped

    with tempfile.TemporaryDirectory() as folder:
        maker = shard.ShardMaker(plan, folder)
        maker(num_shards)  # builds the networks
        (simulator,) = maker.simulators
        object.__setattr__(simulator.coarse, "simulate", timed("coarse simulator", simulator.coarse.simulate))
        simulator.enhance = timed("enhancer", simulator.enhance)
        simulator.noise.generate = timed("noise", simulator.noise.generate)
        shard.make_windows = timed("windows", shard.make_windows)
        began = time.perf_counter()
        for number in range(num_shards):
            maker(number)
        whole = time.perf_counter() - began
    rows = num_shards * plan.shard
    networks = {name: spent[name] for name in ("coarse simulator", "enhancer", "noise")}
    others = {"draws and levels": spent["windows"] - sum(networks.values()), "Parquet and checksum": whole - spent["windows"]}
    product_s, flop = _matrix_product()
    work = simulator.enhancer.count_params() * 2  # a multiplication and an addition for each weight
    return {
        "windows": rows,
        "noise": type(simulator.noise).__name__,
        "seconds_a_window": {name: value / rows for name, value in (networks | others).items()},
        "enhancer_parameters": simulator.enhancer.count_params(),
        "enhancer_flop_a_second": work * rows / networks["enhancer"],
        "matrix_product_flop_a_second": flop / product_s,
    }


def _matrix_product() -> tuple[float, float]:
    """Returns the seconds of the fastest of eight matrix products of the enhancer's size, and the number of operations."""
    from enhsim_tf.keras_tools.backend import tf

    first, second = (tf.random.stateless_uniform(shape, (1, 2)) for shape in ((1_024, 3_200), (3_200, 3_200)))
    product, times = tf.function(tf.matmul), []
    for _ in range(8):
        began = time.perf_counter()
        product(first, second).numpy()
        times.append(time.perf_counter() - began)
    return min(times), 2 * 1_024 * 3_200 * 3_200


def measure_idle(options: argparse.Namespace) -> dict:
    """Measures how many tasks without work an engine can distribute and collect in a second."""
    from enhsim_tf.common.parallel import engines

    engine, workers = IDLE[options.one]
    times = [
        time.perf_counter() for _ in engines.run(engine, operator.index, range(_NUM_IDLE), workers)
    ]  # `operator.index` returns its argument
    return {"shards_a_second": (len(times) - 500) / (times[-1] - times[499])}


def measured(options: argparse.Namespace, name: str, windows: int) -> dict:
    """Runs a measurement in a separate process and returns its result."""
    given = [str(options.models), "--windows", str(windows), "--nominal-share", str(options.nominal_share), "--one", name]
    ended = subprocess.run([sys.executable, "-m", "benchmarks.fleet", *given], capture_output=True, text=True)
    if ended.returncode:
        raise SystemExit(f"{name}: {(ended.stderr.strip().splitlines() or ['no word'])[-1]}")
    return json.loads(ended.stdout.splitlines()[-1])


def main(arguments: list[str] | None = None) -> int:
    """Measures every row and writes the results."""
    options = parse(arguments)
    if options.one:
        measure = measure_row if options.one in ROWS else measure_idle if options.one in IDLE else measure_parts
        print(json.dumps(measure(options)))
        return 0
    from benchmarks.__main__ import machine
    from enhsim_tf.common.atomic_files import write_json

    has_ray = importlib.util.find_spec("ray") is not None
    names = [name for name in ROWS if "ray" not in name or has_ray]
    made = {"machine": machine(), "nominal_share": options.nominal_share, PARTS: measured(options, PARTS, options.windows)}
    made["driver"] = {IDLE[name][0]: measured(options, name, 1) for name in IDLE if "ray" not in name or has_ray}
    found: dict[str, list[dict]] = {name: [] for name in names}
    large: dict[str, dict] = {}

    def measure_and_say(name: str, windows: int) -> dict:
        row = measured(options, name, windows)
        print(f"{name:18} {windows:10,} windows {row['windows_a_second']:10,.0f} a second", flush=True)
        return row

    for _ in range(options.repetitions):
        for name in names:  # alternating, so that other load on the machine affects all rows equally
            found[name].append(measure_and_say(name, options.windows))
    for name in names[1:]:
        large[name] = measure_and_say(name, options.large)
    sets = [[row.pop("sha256") for row in rows] for rows in ([row for rows in found.values() for row in rows], large.values())]
    equal = all(each == same_size[0] for same_size in sets for each in same_size)
    write_json(options.out, made | {"same_bytes": equal, "rows": found, "large": large})
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
