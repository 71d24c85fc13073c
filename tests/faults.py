"""Faults, tried for real on the commands with tiny networks: `python tests/faults.py fleet|reproduce --out docs/faults.json`.

Each try starts a command, does it some harm at a random moment, runs the same command again until it ends well, and
compares what it made with what was made without any disturbance: every byte of the data set of `generate`; every figure's
arrays, every stage and the results without times of `reproduce`. It writes a table: fault, tries, outcomes, seed. The suite
tries the same in small; this takes minutes for `fleet` and about an hour for `reproduce`. `python tests/faults.py readme --out
docs/faults.json` fills the README's table from the file.
"""

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from test_fleet import children_of, content_of  # noqa: E402

from enhsim_tf.files import replace_file, write_json  # noqa: E402
from enhsim_tf.reproduce.report import fill_parts  # noqa: E402

MISSED = "too early or late"  # begins the outcome of a try that met nobody: it does not count, and is done again
MIX = "windows: 6000\nshard: 100\nseed: 5\nnominal: 0.5\nscenarios: [{mode: friction, share: 0.5, severity: [0, 1]}]\n"


class Bench:
    """A place for tries: models, a mix, and the data set as it is without any fault."""

    def __init__(self, folder):
        from test_enhanced_simulator import small

        self.folder = folder
        small(window=60).save(folder / "models" / "volts")
        (folder / "mix.yaml").write_text(MIX)
        began = time.monotonic()
        self.start("undisturbed").communicate()
        self.seconds = time.monotonic() - began
        self.expected = content_of(folder / "undisturbed")

    def start(self, name, *options, **how):
        command = [sys.executable, "-m", "enhsim_tf", "generate", self.folder / "models", "--scenarios", self.folder / "mix.yaml"]
        command += ["--workers", "2", "--out", self.folder / name, *options]
        how = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True} | how
        return subprocess.Popen(list(map(str, command)), **how)

    def moment(self, rng):
        """Waits for a random moment of a run."""
        time.sleep(rng.uniform(0.05, 0.95) * self.seconds)

    def recovered(self, name):
        """Whether the same command, again, ends well and in the same bytes."""
        again = self.start(name)
        err = again.communicate()[1]
        same = content_of(self.folder / name) == self.expected
        shutil.rmtree(self.folder / name)
        return "recovered, same bytes" if again.returncode == 0 and same else f"NOT recovered: {err.strip()[-200:]}"


def kill_driver(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    was_running = process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate()
    return ("" if was_running else f"{MISSED}; ") + bench.recovered(name)


def kill_worker(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    workers = children_of(process)
    if workers:
        os.kill(workers[rng.integers(len(workers))], signal.SIGKILL)
    err = process.communicate()[1]
    missed = "" if workers else f"{MISSED}; "
    return missed + bench.recovered(name) if process.returncode == 0 else f"NOT recovered by itself: {err.strip()[-200:]}"


def interrupt(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    os.killpg(process.pid, signal.SIGINT)
    err = process.communicate()[1]
    if process.returncode == 0:
        return f"{MISSED}; {bench.recovered(name)}"
    one_line = process.returncode == 130 and len(err.splitlines()) == 1
    return f"one line; {bench.recovered(name)}" if one_line else f"NOT one line: {process.returncode} {err.strip()[-200:]}"


def full_disk(bench, name, rng):
    """A tmpfs too small for the data set, made larger afterwards; where none can be mounted, there is no try."""
    folder = bench.folder / name
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={rng.integers(200, 900)}k", "tmpfs", folder], capture_output=True).returncode:
        shutil.rmtree(folder)
        return "not tried: no file system can be mounted here"
    try:
        process = bench.start(name)
        err = process.communicate()[1]
        if process.returncode != 2 or len(err.splitlines()) != 1:
            return f"NOT one line: {process.returncode} {err.strip()[-200:]}"
        subprocess.run(["mount", "-o", "remount,size=100m", folder], check=True)
        again = bench.start(name)
        again.communicate()
        same = again.returncode == 0 and content_of(folder) == bench.expected
        return "one line; recovered, same bytes" if same else "NOT recovered"
    finally:
        subprocess.run(["umount", folder], check=True)
        shutil.rmtree(folder)


def read_only(bench, name, rng):
    """The folder of a run that was killed becomes read-only; writable again afterwards."""
    folder = bench.folder / name
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=100m", "tmpfs", folder], capture_output=True).returncode:
        shutil.rmtree(folder)
        return "not tried: no file system can be mounted here"
    try:
        process = bench.start(name)
        bench.moment(rng)
        workers = children_of(process)
        process.kill()
        process.communicate()
        while any(Path(f"/proc/{worker}").exists() for worker in workers):  # they may have files open
            time.sleep(0.01)
        subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
        process = bench.start(name)
        err = process.communicate()[1]
        subprocess.run(["mount", "-o", "remount,rw", folder], check=True)
        if process.returncode != 2 or len(err.splitlines()) != 1:
            return f"NOT one line: {process.returncode} {err.strip()[-200:]}"
        again = bench.start(name)
        again.communicate()
        same = again.returncode == 0 and content_of(folder) == bench.expected
        return "one line; recovered, same bytes" if same else "NOT recovered"
    finally:
        subprocess.run(["umount", folder], check=True)
        shutil.rmtree(folder)


CLOCK = """
import os, time
_time, _time_ns = time.time, time.time_ns
def _step():
    with open(os.environ["CLOCK_STEP"]) as file:
        return float(file.read() or 0)
time.time, time.time_ns = lambda: _time() + _step(), lambda: _time_ns() + int(1e9 * _step())
"""


@contextlib.contextmanager
def stepping(folder):
    """Yields what steps the clock of a running command by seconds, and the environment to start it with.

    The machine's own clock stays: a `sitecustomize.py` in front of the command's modules shifts `time.time`, by what a file
    says at that moment. `time.monotonic` goes on evenly, as it does when an administrator steps the clock. Files are stamped
    by the kernel; `stepped` shifts their times as the clock would have.
    """
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(CLOCK)

    def step(seconds):
        (folder / "new").write_text(str(seconds))
        os.replace(folder / "new", folder / "seconds")

    step(0)
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        yield step, os.environ | {"PYTHONPATH": path, "CLOCK_STEP": str(folder / "seconds")}
    finally:
        shutil.rmtree(folder)


def stepped(folder, seconds):
    """Moves the times of a folder and of all in it."""
    for path in (folder, *folder.rglob("*")):
        with contextlib.suppress(FileNotFoundError):  # a run may be at work there
            about = path.stat()
            os.utime(path, (about.st_atime + seconds, about.st_mtime + seconds))


def clock_change(bench, name, rng):
    """The clock jumps by years in the middle of a run; the next run finds files of another time, and the clock as it was."""
    with stepping(bench.folder / f"{name}.clock") as (step, environment):
        process = bench.start(name, env=environment)
        bench.moment(rng)
        step(seconds := float(rng.choice([-1, 1]) * rng.uniform(2, 20) * 365 * 86_400))
        if (bench.folder / name).is_dir():
            stepped(bench.folder / name, seconds)
        err = process.communicate()[1]
        if process.returncode or content_of(bench.folder / name) != bench.expected:
            return f"NOT undisturbed: {process.returncode} {err.strip()[-200:]}"
        stepped(bench.folder / name, -2 * seconds)
        return f"went on; {bench.recovered(name)}"


def damaged_shard(bench, name, rng):
    shutil.copytree(bench.folder / "undisturbed", bench.folder / name)
    shard = sorted((bench.folder / name).glob("shard-*"))[rng.integers(60)]
    content = bytearray(shard.read_bytes())
    content[rng.integers(len(content))] ^= 1 << rng.integers(8)
    shard.write_bytes(content)
    verified = subprocess.run([sys.executable, "-m", "enhsim_tf", "verify", bench.folder / name], cwd=ROOT, capture_output=True, text=True)
    found = verified.returncode == 2 and verified.stdout.splitlines() == [f"{shard.name}: its checksum is not the one that was recorded"]
    return f"named by verify; {bench.recovered(name)}" if found else "NOT found by verify"


def damaged_manifest(bench, name, rng):
    shutil.copytree(bench.folder / "undisturbed", bench.folder / name)
    manifest = bench.folder / name / "_manifest.json"
    os.truncate(manifest, rng.integers(manifest.stat().st_size - 2))
    process = bench.start(name)
    err = process.communicate()[1]
    if process.returncode != 2 or "Remove it" not in err or len(err.splitlines()) != 1:
        return f"NOT one line: {process.returncode} {err.strip()[-200:]}"
    manifest.unlink()
    return f"one line; {bench.recovered(name)}"


def damaged_model(bench, name, rng):
    model = bench.folder / "models" / "volts" / "enhancer.keras"
    content = model.read_bytes()
    model.write_bytes(content[: rng.integers(len(content))])
    process = bench.start(name)
    err = process.communicate()[1]
    model.write_bytes(content)
    if process.returncode != 2 or len(err.splitlines()) != 1:
        return f"NOT one line: {process.returncode} {err.strip()[-200:]}"
    return f"one line; {bench.recovered(name)}"


def two_runs(bench, name, rng):
    first = bench.start(name)
    bench.moment(rng)
    second = bench.start(name)
    err = second.communicate()[1]
    first.communicate()
    refused = second.returncode == 2 and len(err.splitlines()) == 1
    late = f"{MISSED}; " if second.returncode == 0 else ""  # the first had ended
    return late + bench.recovered(name) if first.returncode == 0 and (refused or late) else f"NOT refused: {err.strip()[-200:]}"


def lost_node(bench, name, rng):
    """A node of a two-node Ray cluster is removed while both are at work."""
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
        same = process.returncode == 0 and content_of(bench.folder / name) == bench.expected
        shutil.rmtree(bench.folder / name)
        return ("" if was_running else f"{MISSED}; ") + "went on, same bytes" if same else f"NOT recovered: {err.strip()[-300:]}"
    finally:
        cluster.shutdown()


FAULTS = {
    "driver killed (SIGKILL)": kill_driver,
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
TRIES = dict.fromkeys(("driver killed (SIGKILL)", "worker killed (SIGKILL)", "run killed (SIGKILL)"), 20)  # of the others 3


def as_markdown(table):
    """The README's table: what was tried on which command, how often, and what came of it."""
    commands = {"fleet": "`generate --workers`", "reproduce": "`enhsim_tf.reproduce`"}
    lines = ["| fault | command | tries | outcome |", "|---|---|---|---|"]
    for row in table:
        outcomes = row["outcomes"]
        words = "; ".join(f"{count} × {outcome}" if len(outcomes) > 1 else outcome for outcome, count in outcomes.items())
        lines.append(f"| {row['fault']} | {commands[row['of']]} | {row['tries']} | {words} |")
    return (
        "\n".join(lines) + "\n\nFrom `docs/faults.json`, which `python tests/faults.py fleet` and `python tests/faults.py reproduce` wrote."
    )


def fill_readme(table):
    """Writes the table between the README's markers."""
    path = ROOT / "README.md"
    filled = fill_parts(path.read_text(encoding="utf-8"), {"faults": as_markdown(table)}, path.name)
    with replace_file(path) as temporary:
        temporary.write_text(filled, encoding="utf-8")


def main():
    from faults_of_reproduce import FAULTS as OF_REPRODUCE
    from faults_of_reproduce import ReproduceBench

    benches = {"fleet": (Bench, FAULTS), "reproduce": (ReproduceBench, OF_REPRODUCE)}
    parser = argparse.ArgumentParser(description="Faults, tried for real.")
    choices = [*benches, "readme"]
    parser.add_argument(
        "of", choices=choices, help="what is tried: large data sets, or the cache of the paper's reproduction; readme: nothing"
    )
    parser.add_argument("--tries", type=int, help="of each fault (default: 20 of those that kill, 3 of the others)")
    parser.add_argument("--only", choices=[*FAULTS, *OF_REPRODUCE], action="append", help="this fault alone; may be repeated")
    parser.add_argument("--seed", type=int, default=0, help="of the moments and places")
    parser.add_argument("--out", type=Path, required=True, help="the table, as JSON")
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it, and so would what it starts
    kept = json.loads(options.out.read_text()) if options.out.exists() else []
    if options.of == "readme":
        fill_readme(kept)
        return 0
    make, faults = benches[options.of]
    table = [row for row in kept if row["of"] != options.of or (options.only and row["fault"] not in options.only)]
    with tempfile.TemporaryDirectory() as folder:
        bench = make(Path(folder))
        for number, (fault, harm) in enumerate(faults.items()):
            if options.only and fault not in options.only:
                continue
            rng, outcomes, attempts = np.random.default_rng([options.seed, number]), {}, 0
            tries = options.tries or TRIES.get(fault, 3)
            while sum(outcomes.values()) < tries and attempts < 3 * tries:
                outcome = harm(bench, f"try-{number}-{attempts}", rng)
                attempts += 1
                if not outcome.startswith(MISSED):
                    outcomes[outcome] = outcomes.get(outcome, 0) + 1
            row = {"of": options.of, "fault": fault, "tries": sum(outcomes.values()), "outcomes": outcomes}
            table.append(row | {"missed": attempts - sum(outcomes.values()), "seed": options.seed})
            print(f"{fault:34} {row['tries']:3}  " + "; ".join(f"{count} {outcome}" for outcome, count in outcomes.items()), flush=True)
            write_json(options.out, sorted(table, key=lambda row: (row["of"], list(benches[row["of"]][1]).index(row["fault"]))))
    return int(any("NOT" in outcome for row in table for outcome in row["outcomes"]))


if __name__ == "__main__":
    sys.exit(main())
