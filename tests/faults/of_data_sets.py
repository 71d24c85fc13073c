"""Fault injection into `python -m enhsim_tf generate --workers`."""

import os
import shutil
import signal
import time

from tests.datasets.test_generate import children_of, content_of
from tests.faults.in_common import MISSED, ROOT, Bench, full_disk, interrupt, kill, read_only
from tests.faults.small_data_set import plain

MIX = "windows: 6000\nshard: 100\nseed: 5\nnominal: 0.5\nscenarios: [{mode: friction, share: 0.5, severity: [0, 1]}]\n"


class DataSetBench(Bench):
    """A small simulator, a scenario file, and the data set of an undisturbed run."""

    same = "same bytes"

    def __init__(self, folder):
        plain().save(folder / "models" / "volts")
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
    "a node of a Ray cluster removed": lost_node,
}
