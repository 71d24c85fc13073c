"""Runs one implementation in a separate process, and times it on request.

In `python -m benchmarks.worker MODULE FUNCTION JSON`, the function receives the settings and returns a `Work`. Each line on
standard input requests a repetition, and each answer is a line of JSON. The separate process gives each implementation its
own libraries, threads and peak memory.
"""

import importlib
import json
import os
import subprocess
import sys
import time
from typing import Any, ClassVar

from benchmarks.examples import minor_faults

COMMAND = (sys.executable, "-m", "benchmarks.worker")


class Worker:
    """An implementation in a separate process.

    The process inherits the user's environment with the variables of `Worker.processor`. Comparisons also receive the variables
    of `Worker.of_comparisons`, see `benchmarks.machine`. The attribute `faults` holds the number of minor page faults for each
    unit of work, one number for each repetition.

    Args:
        module: Module of this package.
        function: Function of the module that prepares the work.
        **settings: Arguments of the function, of JSON types.
    """

    processor: ClassVar[dict[str, str]] = {}
    of_comparisons: ClassVar[dict[str, str]] = {}

    def __init__(self, module: str, function: str, **settings: Any):
        command = [*COMMAND, module, function, json.dumps(settings)]
        quiet = os.environ | {"TF_CPP_MIN_LOG_LEVEL": "3"} | self.processor | ({} if module == "ours" else self.of_comparisons)
        self.faults: list[float] = []
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=quiet
        )
        self.skipped: str | None = self._answer().get("skipped")

    def repeat(self, argument: int | None = None) -> float:
        """Runs one repetition, of size `argument` if the work has one, and returns the seconds for each unit of work."""
        self._process.stdin.write("\n" if argument is None else f"{argument}\n")
        self._process.stdin.flush()
        answer = self._answer()
        self.faults.append(answer["faults"])
        return answer["seconds"]

    def close(self) -> float:
        """Ends the process and returns its peak memory in MB."""
        if self.skipped:
            return 0.0
        self._process.stdin.close()
        peak = self._answer()["peak_mb"]
        self._process.wait()
        return peak

    def _answer(self) -> dict:
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"Expected an answer. Received: none from {' '.join(self._process.args[2:])}. Run that command by hand.")
        return json.loads(line)


def peak_mb() -> float:
    """Returns the peak resident memory of this process in MB."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024


def main(module: str, function: str, settings: str) -> None:
    """Prepares the work, runs it once as a warm-up, and then once for each line of input."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    try:
        run, units = getattr(importlib.import_module(f"benchmarks.{module}"), function)(**json.loads(settings))
    except ImportError as error:
        answers.write(json.dumps({"skipped": str(error)}) + "\n")
        return
    run()
    answers.write("{}\n")
    for line in sys.stdin:
        arguments = [int(word) for word in line.split()]
        began, faults = time.perf_counter(), minor_faults()
        timed = run(*arguments)
        seconds, faults = time.perf_counter() - began, minor_faults() - faults
        if isinstance(timed, tuple):  # the work has measured its own time
            seconds, faults = timed
        answers.write(json.dumps({"seconds": seconds / units, "faults": faults / units}) + "\n")
    answers.write(json.dumps({"peak_mb": peak_mb()}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
