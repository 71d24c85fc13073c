"""Fault injection into `python -m enhsim_tf.reproduce` and its cache."""

import json
import os
import zipfile

from tests.datasets.test_generate import content_of
from tests.faults.in_common import ROOT, Bench, clock_change, flip, full_disk, interrupt, kill, read_only

DAMAGED = "damaged in the cache"
LEFT_OUT = ("timings", "from_cache", "this_run_s")  # keys of results.json that differ between runs: times, and use of the cache


def found_in(out):
    """The results of a run: the arrays of each figure, and `results.json` without times. `report.html` shows the same, with times."""
    found = content_of(out)
    del found["report.html"]
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    return found | {"results.json": {name: value for name, value in results.items() if name not in LEFT_OUT}}


def kept_in(cache):
    """The exact content of a cache: all files except the times of stages, and for a network its weights.

    Other Keras metadata depends on how many layers the process created before, and therefore on the use of the cache.
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


class ReproduceBench(Bench):
    """The results and the cache of an undisturbed run."""

    same = "same results"
    disks = ("cache", "out")

    def __init__(self, folder):
        super().__init__(folder)
        self.found, self.kept = found_in(folder / "undisturbed" / "out"), kept_in(folder / "undisturbed" / "cache")

    def command(self, name):
        place = self.folder / name
        return [ROOT / "tests" / "faults" / "small_reproduction.py", "--cache", place / "cache", "--out", place / "out"]

    def wrong(self, name):
        place = self.folder / name
        for what, left, expected in (
            ("results", found_in(place / "out"), self.found),
            ("cache", kept_in(place / "cache"), self.kept),  # including leftovers
        ):
            differ = [part for part in sorted(left.keys() | expected.keys()) if left.get(part) != expected.get(part)]
            if differ:
                return f"NOT the same {what}: {differ[0]}"
        return None


def damaged(pattern, harm):
    """A fault that damages one file of a finished cache. The next run must report it and compute the stage again."""

    def fault(bench, name, rng):
        files = sorted(path for path in (bench.copy(name) / "cache").rglob(pattern) if path.is_file())
        harm(files[rng.integers(len(files))], rng)
        return f"told; {bench.recovered(name, DAMAGED)}"

    return fault


def cut(path, rng):
    os.truncate(
        path, rng.integers(path.stat().st_size - 1)
    )  # truncates at least two bytes: losing the final line break alone does no damage


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
    return bench.wrong(name) or f"both ended well, same results; {bench.recovered(name)}"


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
