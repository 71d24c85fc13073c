"""`python -m tests.fuzzing --inputs 100000 --out fuzzing.json`: fuzzes every target in its own process, guided by coverage.

Requires atheris. Failing inputs are saved in the folder of `--failures`. The exit code is 1 if there are any.
"""

import argparse
import importlib.metadata
import json
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzzing.judge import MAX_MIB, MAX_SECONDS
from tests.fuzzing.targets import TARGETS

ROOT = Path(__file__).parents[2]
_MIN_INPUTS = 500  # smallest number of inputs of a target, however slow it is
_PACKAGES = ("atheris", "tensorflow", "keras", "numpy", "pandas", "pyarrow", "h5py", "pyyaml")


def shares(num_inputs: int, names: list[str]) -> dict[str, int]:
    """Distributes the inputs over the targets. Rounding may add a few.

    Args:
        num_inputs: Total number of inputs.
        names: Names of the targets.
    """
    total = sum(TARGETS[name].weight for name in names)
    return {name: max(min(_MIN_INPUTS, num_inputs), -int(-num_inputs * TARGETS[name].weight // total)) for name in names}


def run(name: str, num_inputs: int, seed: int, failures: Path) -> dict[str, float]:
    """Runs one target and returns its counts of outcomes.

    Args:
        name: Name of the target.
        num_inputs: Number of inputs.
        seed: Seed of the mutations.
        failures: Folder in which failing inputs are saved.
    """
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "record.json"
        command = [sys.executable, "-m", "tests.fuzzing.worker", name, num_inputs, seed, record, failures]
        ended = subprocess.run(list(map(str, command)), cwd=ROOT, capture_output=True, text=True, errors="replace")
        found = json.loads(record.read_text()) if record.exists() else {"inputs": 0, "accepted": 0, "refused": 0, "failed": 0}
    counters = [int(number) for number in re.findall(r"cov: (\d+)", ended.stderr)] or [0]
    found |= {"counters_at_first": counters[0], "counters": counters[-1], "seconds": round(time.monotonic() - began)}
    if found["inputs"] < num_inputs:
        (failures / f"{name.replace(' ', '-')}-ended.txt").write_text(ended.stderr[-20_000:])
        found["failed"] += 1  # the process ended early
    return found


def main() -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzzing", description="Tries changed inputs on everything that reads files.")
    parser.add_argument("--inputs", type=int, default=100_000, help="in all (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="a JSON file that takes the record")
    parser.add_argument(
        "--failures", type=Path, default=Path(tempfile.gettempdir()) / "enhsim_tf_failures", help="where inputs that fail go"
    )
    parser.add_argument("--seed", type=int, default=0, help="of every change (default: %(default)s)")
    parser.add_argument("--only", action="append", choices=TARGETS, help="only this target; may be repeated")
    options = parser.parse_args()
    options.failures.mkdir(parents=True, exist_ok=True)
    found = {}
    for name, num_inputs in shares(options.inputs, options.only or list(TARGETS)).items():
        found[name] = run(name, num_inputs, options.seed, options.failures.absolute())
        print(f"{name:40} {json.dumps(found[name])}", flush=True)
    sums = {key: sum(target[key] for target in found.values()) for key in ("inputs", "accepted", "refused", "failed", "seconds")}
    largest = {key: max(target.get(key, 0) for target in found.values()) for key in ("slowest_s", "peak_mib", "more_than_at_first_mib")}
    about = {"command": f"python -m tests.fuzzing --inputs {options.inputs} --seed {options.seed}", "seed": options.seed}
    about |= {"most_seconds": MAX_SECONDS, "most_mib": MAX_MIB}
    versions = {"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in _PACKAGES}
    record = about | {"all": sums | largest, "targets": found, "versions": versions}
    options.out.write_text(json.dumps(record, indent=2) + "\n")
    print(f"{sums['inputs']:,} inputs, {sums['accepted']:,} accepted, {sums['refused']:,} refused, {sums['failed']:,} failed")
    return 1 if sums["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
