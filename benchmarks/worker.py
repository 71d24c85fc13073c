"""Runs one implementation in a separate process, and times it on request.

In `python -m benchmarks.worker MODULE FUNCTION JSON`, the function receives the settings and
returns a `Work`. Each line on standard input requests a repetition, and each answer is a line of
JSON. The separate process gives each implementation its own libraries and threads.
"""

import importlib
import json
import os
import subprocess
import sys
import time
from typing import Any


class Worker:
    """An implementation in a separate process.

    Args:
        module: Module of this package.
        function: Function of the module that prepares the work.
        **settings: Arguments of the function, of JSON types.
    """

    def __init__(self, module: str, function: str, **settings: Any):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.worker", module, function, json.dumps(settings)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"TF_CPP_MIN_LOG_LEVEL": "3"},
        )
        self.skipped: str | None = self._answer().get("skipped")

    def repeat(self) -> float:
        """Runs one repetition and returns the seconds for each unit of work."""
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return self._answer()["seconds"]

    def close(self) -> None:
        """Ends the process."""
        self._process.communicate()

    def _answer(self) -> dict:
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(
                f"Expected an answer. Received: none from {' '.join(self._process.args[2:])}. Run "
                "that command by hand."
            )
        return json.loads(line)


def main(module: str, function: str, settings: str) -> None:
    """Prepares the work, runs it once as a warm-up, and then once for each line of input."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    try:
        run, units = getattr(importlib.import_module(f"benchmarks.{module}"), function)(
            **json.loads(settings)
        )
    except ImportError as error:
        answers.write(json.dumps({"skipped": str(error)}) + "\n")
        return
    run()
    answers.write("{}\n")
    for _ in sys.stdin:
        began = time.perf_counter()
        timed = run()
        # some works measure their own time
        seconds = timed if isinstance(timed, float) else time.perf_counter() - began
        answers.write(json.dumps({"seconds": seconds / units}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
