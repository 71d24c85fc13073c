"""Fault injection into `python -m enhsim_tf generate --workers`."""

import os
import shutil
import signal
import subprocess
import sys
import time

from tests.datasets.test_generate import children_of, content_of
from tests.faults.in_common import MISSED, ROOT, Bench, clock_change, flip, full_disk, interrupt, kill, not_one_line, read_only

MIX = "windows: 6000\nshard: 100\nseed: 5\nnominal: 0.5\nscenarios: [{mode: friction, share: 0.5, severity: [0, 1]}]\n"


class DataSetBench(Bench):
    """Tiny networks, a scenario file, and the data set of an undisturbed run."""

    same = "same bytes"

    def __init__(self, folder):
        from tests.enhanced_simulator.test_simulator import small  # TensorFlow takes a while, and filling the README needs none

        small(window=60).save(folder / "models" / "volts")
        (folder / "mix.yaml").write_text(MIX)
        super().__init__(folder)
        self.expected = content_of(folder / "undisturbed")

    def command(self, name):
        options = ["--scenarios", self.folder / "mix.yaml", "--workers", "2", "--out", self.folder / name]
        return ["-m", "enhsim_tf", "generate", self.folder / "models", *options]

    def wrong(self, name):
        return None if content_of(self.folder / name) == self.expected else "NOT the same bytes"


def kill_worker(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    workers = children_of(process)
    if workers:
        os.kill(workers[rng.integers(len(workers))], signal.SIGKILL)
    err = process.communicate()[1]
    missed = "" if workers else f"{MISSED}; "
    return missed + bench.recovered(name) if process.returncode == 0 else f"NOT recovered by itself: {err.strip()[-200:]}"


def damaged_shard(bench, name, rng):
    shard = sorted(bench.copy(name).glob("shard-*"))[rng.integers(60)]
    flip(shard, rng)
    verified = subprocess.run([sys.executable, "-m", "enhsim_tf", "verify", bench.folder / name], cwd=ROOT, capture_output=True, text=True)
    found = verified.returncode == 2 and verified.stdout.splitlines() == [f"{shard.name}: its checksum differs from the recorded one"]
    return f"named by verify; {bench.recovered(name)}" if found else "NOT found by verify"


def damaged_manifest(bench, name, rng):
    manifest = bench.copy(name) / "_manifest.json"
    os.truncate(manifest, rng.integers(manifest.stat().st_size - 2))
    code, _, err = bench.ran(name)
    if "Remove it" not in err:
        return f"NOT said what to do: {code} {err.strip()[-200:]}"
    manifest.unlink()
    return not_one_line(code, err) or f"one line; {bench.recovered(name)}"


def damaged_model(bench, name, rng):
    model = bench.folder / "models" / "volts" / "arrays.npz"
    content = model.read_bytes()
    model.write_bytes(content[: rng.integers(len(content))])
    code, _, err = bench.ran(name)
    model.write_bytes(content)
    return not_one_line(code, err) or f"one line; {bench.recovered(name)}"


def two_runs(bench, name, rng):
    first = bench.start(name)
    bench.moment(rng)
    code, _, err = bench.ran(name)
    first.communicate()
    late = f"{MISSED}; " if code == 0 else ""  # the first run had already ended
    wrong = not_one_line(code, err) if code else None
    if first.returncode:
        wrong = f"NOT undisturbed: {first.returncode}"
    return wrong or late + bench.recovered(name)


def lost_node(bench, name, rng):
    """Removes one node of a two-node Ray cluster while both nodes are working."""
    try:
        from ray.cluster_utils import Cluster
    except ModuleNotFoundError:
        return "not tried: the optional extra ray is not installed"
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        node = cluster.add_node(num_cpus=1)
        process = bench.start(name, "--engine", "ray", env=os.environ | {"RAY_ADDRESS": cluster.address, "PYTHONPATH": str(ROOT)})
        while not list((bench.folder / name).glob("shard-*")) and process.poll() is None:
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 1))
        was_running = process.poll() is None
        cluster.remove_node(node, allow_graceful=False)
        err = process.communicate()[1]
        wrong = f"NOT recovered: {err.strip()[-300:]}" if process.returncode else bench.wrong(name)
        shutil.rmtree(bench.folder / name)
        return wrong or ("" if was_running else f"{MISSED}; ") + f"went on, {bench.same}"
    finally:
        cluster.shutdown()


FAULTS = {
    "driver killed (SIGKILL)": kill,
    "worker killed (SIGKILL)": kill_worker,
    "interrupt by the user (SIGINT)": interrupt,
    "disk full (a small tmpfs)": full_disk,
    "read-only output": read_only,
    "damaged shard": damaged_shard,
    "damaged manifest": damaged_manifest,
    "damaged model": damaged_model,
    "two runs into one folder": two_runs,
    "clock change": clock_change,
    "a node of a Ray cluster removed": lost_node,
}
