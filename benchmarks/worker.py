"""One way of doing a work, alone in a process: it repeats when it is told to and says how long that took.

`python -m benchmarks.worker MODULE FUNCTION JSON`: the function gets the settings and returns what to repeat and how many
units of work one repetition is. Each line on standard input asks for a repetition; each answer is a line of JSON.
A process of its own gives each way its own libraries, its own threads and its own peak of memory.
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
    """A way of doing a work, in a process of its own.

    Args:
        module: Module of this package.
        function: Its function, which prepares the work.
        **settings: What the function gets, in plain JSON types.

    The worker runs in the user's environment, with `Worker.processor` on top, and a comparison with `Worker.of_comparisons`
    besides (see `benchmarks.machine`). `faults` holds the minor page faults a unit of work, a number for each repetition.
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
        """Does one repetition, of the size `argument` where the work takes one; seconds a unit of work."""
        self._process.stdin.write("\n" if argument is None else f"{argument}\n")
        self._process.stdin.flush()
        answer = self._answer()
        self.faults.append(answer["faults"])
        return answer["seconds"]

    def close(self) -> float:
        """Ends the process; its peak of memory in MB."""
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
    """Peak of this process's resident memory in MB."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024


def main(module: str, function: str, settings: str) -> None:
    """Prepares the work, does it once to warm up, then a repetition for each line of input."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints is no answer
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
        if isinstance(timed, tuple):  # a work may hold the clock itself
            seconds, faults = timed
        answers.write(json.dumps({"seconds": seconds / units, "faults": faults / units}) + "\n")
    answers.write(json.dumps({"peak_mb": peak_mb()}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
