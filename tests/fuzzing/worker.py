"""Fuzzes one target in its own process. atheris mutates the inputs, guided by their coverage of the package's code.

`python -m tests.fuzzing.worker TARGET INPUTS SEED RECORD FAILURES`; libFuzzer prints its coverage counters on standard error.
"""

import atexit
import json
import os
import random
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
import atheris  # noqa: E402

with atheris.instrument_imports(include=["enhsim_tf"], enable_loader_override=False):
    from tests.fuzzing.targets import TARGETS

from tests.fuzzing.judge import MAX_MIB, judge, limit_memory, peak_mib  # noqa: E402

_MAX_FAILURES = 5  # failing inputs saved for each target


def main(name: str, num_inputs: int, seed: int, record: Path, failures: Path) -> None:
    """Runs the inputs of a target and writes the counts of outcomes.

    Args:
        name: Name of the target.
        num_inputs: Number of inputs.
        seed: Seed of the mutations.
        record: JSON file for the counts.
        failures: Folder in which failing inputs are saved.
    """
    target, folder = TARGETS[name], Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    seeds, rng = target.seeds(), random.Random(seed)
    for data in seeds:
        judge(target.run, data, folder / "work")  # triggers late imports before memory is measured
    counts = {"inputs": 0, "accepted": 0, "refused": 0, "failed": 0, "unused": 0, "slowest_s": 0.0}
    begin_mib = peak_mib()
    limit_memory(2 * MAX_MIB)

    def try_one(data: bytes) -> None:
        if counts["inputs"] >= num_inputs:
            return
        outcome = judge(target.run, data, folder / "work")
        counts[outcome.verdict] += 1
        counts["inputs"] = sum(counts[verdict] for verdict in ("accepted", "refused", "failed"))
        counts["slowest_s"] = max(counts["slowest_s"], round(outcome.seconds, 3))
        if outcome.verdict == "failed" and counts["failed"] <= _MAX_FAILURES:
            path = failures / f"{name.replace(' ', '-')}-{counts['failed']}"
            path.write_bytes(data)
            path.with_suffix(".txt").write_text(outcome.why)
        if counts["inputs"] % 100 == 0 or counts["inputs"] >= num_inputs:
            memory = {"peak_mib": round(peak_mib()), "more_than_at_first_mib": round(peak_mib() - begin_mib)}
            record.write_text(json.dumps(counts | memory))

    def change(data: bytes, most_bytes: int, seed: int) -> bytes:
        own = random.Random(seed ^ rng.getrandbits(32))
        if own.random() < 0.3:
            return atheris.Mutate(data, most_bytes)
        return target.change(data if own.random() < 0.8 else own.choice(seeds), own, seeds)[:most_bytes]

    corpus = folder / "corpus"
    corpus.mkdir()
    for number, data in enumerate(seeds):
        (corpus / str(number)).write_bytes(data)
    most = max(4_096, 2 * max(map(len, seeds)))
    options = [f"-seed={seed + 1}", f"-max_len={most}", "-rss_limit_mb=0", "-timeout=60", "-len_control=0", "-print_final_stats=1"]
    options += [f"-atheris_runs={2 * num_inputs + len(seeds)}", f"-artifact_prefix={failures}/crash-{name.replace(' ', '-')}-", str(corpus)]
    atheris.Setup([sys.argv[0], *options], try_one, custom_mutator=change)
    atexit.register(lambda: __import__("shutil").rmtree(folder, ignore_errors=True))
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]), Path(sys.argv[5]))
