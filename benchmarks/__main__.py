"""The command `python -m benchmarks`: runs the benchmarks, prints each row and writes
`results.json`.
"""

import argparse
import os
import platform
import re
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

RESULTS = Path(__file__).parent / "results.json"


def machine() -> dict:
    """Returns the processor with its vector instruction sets (on Linux), and the versions of the
    numerical libraries.
    """
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text(encoding="ascii", errors="replace") if cpuinfo.is_file() else ""
    name = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    return {
        "processor": name[1].strip() if name else platform.processor() or platform.machine(),
        "instruction_sets": sorted(
            set(re.findall(r"\b(?:sse4_2|avx\w*|fma|amx\w*|asimd|sve\w*)\b", text))
        ),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{
            name: _version(name)
            for name in ("tensorflow", "keras", "tf_keras", "torch", "numpy", "pyarrow")
        },
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def main(arguments: list[str] | None = None) -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Speed of enhsim_tf, compared with other implementations and with the limits "
        "of the machine, in some minutes. `python -m book --tables` then takes the results into "
        "docs/speed.md.",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=RESULTS,
        help="the results (default: results.json beside this program)",
    )
    options = parser.parse_args(arguments)

    from benchmarks import rows
    from benchmarks.report import line_of
    from enhsim_tf.common.atomic_files import write_json

    found = []
    for measured in (rows.enhancer, rows.gan, rows.generation, rows.starting):
        for row in measured():
            found.append(row)
            print(line_of(row), flush=True)
    write_json(options.out, {"machine": machine(), "rows": found})
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
