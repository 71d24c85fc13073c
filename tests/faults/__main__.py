"""Fault injection into the real commands with tiny networks: `python -m tests.faults fleet|reproduce --out faults.json`.

Each try starts a command, injects a fault at a random moment, runs the same command again until it succeeds, and
compares the results with those of an undisturbed run: every byte of the data set of `generate`; every
figure, every stage and the results without times of `reproduce`. It writes a table: fault, tries, outcomes, seed. The suite
tries the same on a smaller scale; this takes minutes for `fleet` and about an hour for `reproduce`. docs/large_data_sets.md quotes it.
"""

import argparse
import json
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np

from enhsim_tf.common.atomic_files import write_json
from tests.faults import of_data_sets, of_reproduce
from tests.faults.in_common import MISSED

BENCHES = {"fleet": (of_data_sets.DataSetBench, of_data_sets.FAULTS), "reproduce": (of_reproduce.ReproduceBench, of_reproduce.FAULTS)}
TRIES = dict.fromkeys(("driver killed (SIGKILL)", "worker killed (SIGKILL)", "run killed (SIGKILL)"), 20)  # of the others 3


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description="Faults, tried for real.")
    parser.add_argument("of", choices=BENCHES, help="what is tried: large data sets, or the cache of the paper's reproduction")
    parser.add_argument("--tries", type=int, help="of each fault (default: 20 of those that kill, 3 of the others)")
    parser.add_argument(
        "--only",
        choices=sorted({fault for _, faults in BENCHES.values() for fault in faults}),
        action="append",
        help="this fault alone; may be repeated",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the moments and places")
    parser.add_argument("--out", type=Path, required=True, help="the table, as JSON")
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore SIGINT, and so would their child processes
    kept = json.loads(options.out.read_text()) if options.out.exists() else []
    make, faults = BENCHES[options.of]
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
                if not outcome.startswith(MISSED) or "NOT" in outcome:
                    outcomes[outcome] = outcomes.get(outcome, 0) + 1
            row = {"of": options.of, "fault": fault, "tries": sum(outcomes.values()), "outcomes": outcomes}
            table.append(row | {"missed": attempts - sum(outcomes.values()), "seed": options.seed})
            print(f"{fault:34} {row['tries']:3}  " + "; ".join(f"{count} {outcome}" for outcome, count in outcomes.items()), flush=True)
            write_json(options.out, sorted(table, key=lambda row: (row["of"], list(BENCHES[row["of"]][1]).index(row["fault"]))))
    return int(any("NOT" in outcome for row in table for outcome in row["outcomes"]))


if __name__ == "__main__":
    sys.exit(main())
