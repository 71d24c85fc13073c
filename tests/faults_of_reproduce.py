"""The faults of `faults.py`, tried on the cache of `python -m enhsim_tf.reproduce`: see there."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

from faults import MISSED
from test_fleet import content_of

ROOT = Path(__file__).parents[1]
DAMAGED = "damaged in the cache"
LEFT_OUT = ("timings", "from_cache", "this_run_s")  # of results.json: times, and whether the cache had it


def found_in(out):
    """What a run found: each figure with its arrays, and `results.json` without times. `report.html` shows the same, with times."""
    found = content_of(out)
    del found["report.html"]
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    return found | {"results.json": {name: value for name, value in results.items() if name not in LEFT_OUT}}


def kept_in(cache):
    """What a cache holds, to the byte: all files but the times of stages, and of a network its weights.

    What Keras writes beside them counts how many layers the process has made before, so whether a stage came from the cache.
    """
    kept = {}
    for path in sorted(path for path in cache.rglob("*") if path.is_file() and path.name != "stage.json"):
        name = str(path.relative_to(cache))
        if path.suffix == ".keras":
            with zipfile.ZipFile(path) as archive:
                kept[name] = archive.read("model.weights.h5")
        else:
            kept[name] = path.read_bytes()
    return kept


class ReproduceBench:
    """A place for tries: what a run finds without any fault, and its cache."""

    def __init__(self, folder):
        self.folder = folder
        began = time.monotonic()
        code, _, err = self.ran("undisturbed")
        if code:
            raise SystemExit(f"the undisturbed run failed: {err}")
        self.seconds = time.monotonic() - began
        self.found, self.kept = found_in(folder / "undisturbed" / "out"), kept_in(folder / "undisturbed" / "cache")

    def start(self, name, cache=None, out=None, **how):
        place = self.folder / name
        command = [
            sys.executable,
            ROOT / "tests" / "reproduce_works.py",
            "--cache",
            cache or place / "cache",
            "--out",
            out or place / "out",
        ]
        how = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True} | how
        return subprocess.Popen(list(map(str, command)), **how)

    def ran(self, name, **how):
        """A run to its end: its exit code, what it said, and its errors."""
        process = self.start(name, **how)
        out, err = process.communicate()
        return process.returncode, out, err

    def moment(self, rng):
        """Waits for a random moment of a run."""
        time.sleep(rng.uniform(0.02, 0.95) * self.seconds)

    def copy(self, name):
        """A finished run, to be damaged."""
        shutil.copytree(self.folder / "undisturbed", self.folder / name)
        return self.folder / name / "cache"

    def equal(self, name):
        """What is wrong with what a run left, if anything."""
        place = self.folder / name
        found = found_in(place / "out")
        wrong = [name for name in sorted(found.keys() | self.found.keys()) if found.get(name) != self.found.get(name)]
        if wrong:
            return f"NOT the same results: {wrong[0]}"
        kept = kept_in(place / "cache")
        wrong = [name for name in sorted(kept.keys() | self.kept.keys()) if kept.get(name) != self.kept.get(name)]
        return f"NOT the same cache: {wrong[0]}" if wrong else None  # leftovers among it

    def recovered(self, name, word=None):
        """Whether the same command, again, ends well and finds the same; and says the word, where one is expected."""
        code, out, err = self.ran(name)
        wrong = f"NOT recovered: {code} {err.strip()[-200:]}" if code or err else self.equal(name)
        if wrong is None and word is not None and out.count(word) != 1:
            wrong = f"NOT said: {word}"
        if wrong is None:
            shutil.rmtree(self.folder / name)
        return wrong or "recovered, same results"


def is_one_line(code, err):
    """Whether a command ended as a user's mistake does."""
    return code == 2 and len(err.splitlines()) == 1 and err.startswith("error: ")


def kill(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    was_running = process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate()
    return ("" if was_running else f"{MISSED}; ") + bench.recovered(name)


def interrupt(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    os.killpg(process.pid, signal.SIGINT)
    err = process.communicate()[1]
    if process.returncode == 0:
        return f"{MISSED}; {bench.recovered(name)}"
    one_line = process.returncode == 130 and len(err.splitlines()) == 1
    return f"one line; {bench.recovered(name)}" if one_line else f"NOT one line: {process.returncode} {err.strip()[-300:]}"


@contextlib.contextmanager
def small_disk(folder, size):
    """Yields whether a file system of this size, in kilobytes, could be mounted on a new folder; it goes with all that it holds."""
    folder.mkdir(parents=True)
    mounted = not subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", folder], capture_output=True).returncode
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", folder], check=True)


def full_disk(bench, name, rng):
    """A tmpfs that fills up while the cache grows, or at the latest with the outputs; made larger afterwards."""
    total = sum(path.stat().st_size for path in (bench.folder / "undisturbed").rglob("*")) // 1024
    place = bench.folder / name
    with small_disk(place, int(rng.uniform(0.001, 0.99) * total)) as mounted:
        if not mounted:
            return "not tried: no file system can be mounted here"
        code, _, err = bench.ran(name)
        if not is_one_line(code, err):
            return f"NOT one line: {code} {err.strip()[-300:]}"
        subprocess.run(["mount", "-o", f"remount,size={10 * total}k", place], check=True)
        code, _, err = bench.ran(name)
        wrong = f"NOT recovered: {err.strip()[-200:]}" if code else bench.equal(name)
    shutil.rmtree(place)
    return wrong or "one line; recovered, same results"


def read_only(bench, name, rng):
    """The cache or the output becomes read-only after a run was killed at a random moment; writable again afterwards."""
    which = ("cache", "out")[rng.integers(2)]
    place = bench.folder / name
    with small_disk(place / which, 1_000_000) as mounted:
        if not mounted:
            return "not tried: no file system can be mounted here"
        process = bench.start(name)
        bench.moment(rng)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        subprocess.run(["mount", "-o", "remount,ro", place / which], check=True)
        code, _, err = bench.ran(name)
        subprocess.run(["mount", "-o", "remount,rw", place / which], check=True)
        if not is_one_line(code, err):
            return f"NOT one line: {code} {err.strip()[-300:]}"
        code, _, err = bench.ran(name)
        wrong = f"NOT recovered: {err.strip()[-200:]}" if code else bench.equal(name)
    shutil.rmtree(place)
    return wrong or f"one line ({which}); recovered, same results"


def damaged(pattern, harm):
    """A fault: one file of a finished cache is damaged; the next run has to say so and do its stage again."""

    def fault(bench, name, rng):
        files = sorted(path for path in bench.copy(name).rglob(pattern) if path.is_file())
        path = files[rng.integers(len(files))]
        harm(path, rng)
        return f"told; {bench.recovered(name, DAMAGED)}"

    return fault


def flip(path, rng):
    content = bytearray(path.read_bytes())
    content[rng.integers(len(content))] ^= 1 << rng.integers(8)
    path.write_bytes(content)


def cut(path, rng):
    os.truncate(path, rng.integers(path.stat().st_size - 1))  # the last byte of a stage.json is the line's end, which nobody misses


def flip_or_cut(path, rng):
    (flip, cut)[rng.integers(2)](path, rng)


def two_runs(bench, name, rng):
    first = bench.start(name)
    bench.moment(rng)
    second = bench.start(name)
    for process in (first, second):
        err = process.communicate()[1]
        if process.returncode or err:
            return f"NOT both ended well: {process.returncode} {err.strip()[-300:]}"
    wrong = bench.equal(name)
    return wrong or f"both ended well, same results; {bench.recovered(name)}"


def clock_change(bench, name, rng):
    """The clock jumps by years in the middle of a run; the next run finds files of another time, and jumps back."""
    from faults import stepped, stepping

    with stepping(bench.folder / f"{name}.clock") as (step, environment):
        process = bench.start(name, env=environment)
        bench.moment(rng)
        step(seconds := float(rng.choice([-1, 1]) * rng.uniform(2, 20) * 365 * 86_400))
        err = process.communicate()[1]
        if process.returncode or err:
            return f"NOT undisturbed: {process.returncode} {err.strip()[-300:]}"
        if wrong := bench.equal(name):
            return wrong
        stepped(bench.folder / name, -seconds)
        return f"went on; {bench.recovered(name)}"


FAULTS = {
    "run killed (SIGKILL)": kill,
    "interrupt by the user (SIGINT)": interrupt,
    "disk full (a small tmpfs)": full_disk,
    "read-only cache or output": read_only,
    "damaged array of a stage": damaged("*.npz", flip_or_cut),
    "damaged stage.json": damaged("stage.json", flip_or_cut),
    "damaged saved network": damaged("*.keras", flip_or_cut),
    "missing file of a stage": damaged("*", lambda path, rng: path.unlink()),
    "two runs with one cache at once": two_runs,
    "clock change": clock_change,
}
