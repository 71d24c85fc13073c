"""Fault injection into `python -m enhsim_tf.reproduce` and its cache."""

import json

from tests.datasets.test_generate import content_of
from tests.faults.in_common import ROOT, Bench, full_disk, interrupt, kill, read_only

LEFT_OUT = ("seconds", "stages", "from_cache")  # keys of results.json that differ between runs: times, and use of the cache


def found_in(out):
    """The results of a run: its figures, and `results.json` without times. `report.html` shows the same, with times."""
    found = content_of(out)
    del found["report.html"]
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    return found | {"results.json": {name: value for name, value in results.items() if name not in LEFT_OUT}}


def kept_in(cache):
    """The exact content of a cache: all files except the times of stages."""
    paths = (path for path in sorted(cache.rglob("*")) if path.is_file() and path.name != "stage.json")
    return {str(path.relative_to(cache)): path.read_bytes() for path in paths}


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


FAULTS = {
    "run killed (SIGKILL)": kill,
    "interrupt by the user (SIGINT)": interrupt,
    "disk full (a small tmpfs)": full_disk,
    "read-only cache or output": read_only,
}
