"""The command `python -m benchmarks.reading`: CPU time of `read_telemetry` over that of
`pandas.read_csv` with `parse_dates`, for a file of a million rows, dates and three channels.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.rows import in_turns, spread
from enhsim_tf.telemetry.sources import read_telemetry

ROWS = 1_000_000
REPETITIONS = 7


def write_table(path: Path, rows: int) -> None:
    """Writes a table of ISO 8601 dates in UTC and three channels."""
    rng = np.random.default_rng(0)
    table = {
        "time": pd.date_range("2024-03-01", periods=rows, freq="s", tz="UTC").strftime("%FT%TZ")
    }
    wave = 20 + 5 * np.sin(np.arange(rows) / 50)
    table |= {name: (wave + rng.normal(0, 0.1, rows)).round(4) for name in "abc"}
    pd.DataFrame(table).to_csv(path, index=False)


def cpu_s(work: Callable[[], object]) -> float:
    """Returns the CPU seconds of a call."""
    before = time.process_time()
    work()
    return time.process_time() - before


def main() -> None:
    """Runs the command."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        write_table(path, ROWS)
        ways = {
            "read_telemetry": lambda: cpu_s(lambda: read_telemetry(path)),
            "read_csv": lambda: cpu_s(lambda: pd.read_csv(path, parse_dates=["time"])),
        }
        seconds = in_turns(ways, REPETITIONS)
    ratios = [ours / theirs for ours, theirs in zip(*seconds.values(), strict=True)]
    for name, values in [*seconds.items(), ("ratio", ratios)]:
        print("{:16}{median:7.2f}  ({low:.2f} to {high:.2f})".format(name, **spread(values)))


if __name__ == "__main__":
    main()
