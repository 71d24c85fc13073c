"""Console output of the commands: printed lines, progress, and one-line error messages."""

import argparse
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    from tqdm import tqdm


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `InputError`, so that a wrong option ends in one line and exit code 2."""

    def error(self, message: str) -> NoReturn:
        """Raises an `InputError` for a command line that cannot be parsed."""
        missing = message.partition("arguments are required: ")[2]
        if missing:
            raise InputError(f"Expected {missing}. Received: no such argument. See {self.prog} --help.")
        raise InputError(f"Expected options as --help lists them. Received: {' '.join(message.split())}.")


def tell(line: str) -> None:
    """Prints one or more lines and flushes, so that they are also visible at once through a pipe.

    Args:
        line: The text. Unprintable characters, for example in channel names, are replaced by question marks.
    """
    text, encoding = "\n".join(printable(each) for each in line.split("\n")), getattr(sys.stdout, "encoding", None) or "utf-8"
    text = text.encode(encoding, "replace").decode(encoding)  # characters that the terminal cannot encode become "?"
    print(f"{text}\n", end="", flush=True)  # text and line break in one write, since other processes may print at the same time


def progress(*arguments: Any, **options: Any) -> "tqdm":
    """Creates a `tqdm` progress bar with a lock that is local to this process.

    The default lock of `tqdm` holds a semaphore shared between processes. If a pool process is terminated while it has one,
    Python warns the user about a leaked semaphore.

    Args:
        *arguments: Positional arguments of `tqdm`.
        **options: Keyword arguments of `tqdm`.

    Returns:
        The progress bar.
    """
    from tqdm import tqdm

    if not hasattr(tqdm, "_lock"):
        tqdm.set_lock(threading.RLock())
    return tqdm(*arguments, **options)


INTERVAL_S = 15.0  # without a terminal, seconds between two progress lines


class Progress:
    """Reports the progress of long work as text lines, for output that cannot show progress bars.

    A line is printed when `INTERVAL_S` seconds have passed since the last one.

    Args:
        tell: Called with each line. None: no lines are printed.
        before: Prefix of each line, such as the name of the work.
        clock: Monotonic clock in seconds.
    """

    def __init__(self, tell: Callable[[str], None] | None = None, before: str = "", clock: Callable[[], float] = time.monotonic):
        self.tell, self.before, self.clock, self.last_line_s = tell, before, clock, clock()

    def step(self, what: str) -> None:
        """Says at once what begins.

        Args:
            what: The step, such as `noise`.
        """
        if self.tell is not None:
            self.last_line_s = self.clock()
            self.tell(f"{self.before}{what} ...")

    def loop(self, unit: str, total: int) -> "Loop":
        """Starts to report a loop.

        Args:
            unit: What the loop counts, such as `epoch`.
            total: Number of units in the loop.

        Returns:
            The `Loop`, to be called with the number of finished units.
        """
        return Loop(self, unit, total)


class Loop:
    """One loop of long work, called with the number of finished units. The number may be fractional.

    The remaining time is extrapolated from all steps except the first, because the first step also builds the network's graph.

    Args:
        progress: The `Progress` that prints the lines.
        unit: What the loop counts, such as `epoch`.
        total: Number of units in the loop.
    """

    def __init__(self, progress: Progress, unit: str, total: int):
        self.progress, self.unit, self.total = progress, unit, total
        self.first: tuple[float, float] | None = None  # time at which the first step ended, and units finished by then

    def __call__(self, done: float) -> None:
        """Prints a line if one is due. The unit in progress is counted from 1: with 6.2 of 40 units finished, it is unit 7.

        Args:
            done: Number of finished units.
        """
        if self.progress.tell is None or not 0 < done < self.total:
            return
        now = self.progress.clock()
        self.first = self.first or (now, done)
        if now - self.progress.last_line_s < INTERVAL_S:
            return
        self.progress.last_line_s = now
        line = f"{self.progress.before}{self.unit} {math.ceil(done):,} of {self.total:,}, {math.floor(100 * done / self.total)} %"
        began, before = self.first
        if done > before:
            line += f", {time_left((now - began) / (done - before) * (self.total - done))}"
        self.progress.tell(line)

    def within(self, before: int, steps: int = 1) -> Callable[[float], None]:
        """Returns a callback that reports progress inside one unit.

        Args:
            before: Number of units finished before this one.
            steps: Number of steps in a unit. With 1, the callback counts whole units.

        Returns:
            A function to be called with the number of finished steps.
        """
        return lambda done: self(before + done / steps)


SILENT = Progress()


def time_left(seconds: float) -> str:
    """Formats a remaining time, such as "about 5 min left"."""
    if seconds < 120:
        return f"about {max(1, round(seconds))} s left"
    return f"about {round(seconds / 60)} min left" if seconds < 7_200 else f"about {seconds / 3_600:.1f} h left"


def run_command(run: Callable[[], int], interrupted: str) -> int:
    """Runs a command, prints its error as one line and returns its exit code.

    The exit code is 2 for a user's mistake and for errors of files or memory, 130 for an interrupt, and 141 for a closed
    output pipe. 130 and 141 follow the convention of shells.

    Args:
        run: The command, a function that returns the exit code.
        interrupted: Message printed after an interrupt.

    Returns:
        The exit code.
    """
    try:
        return run()
    except InputError as error:
        print(f"error: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  Python flushes stdout again at exit
        return 141
    except (OSError, MemoryError) as error:
        reason = " ".join(str(error).splitlines())[:300] or "too little memory"
        line = InputError(f"Expected enough memory and files that can be used. Received: {reason}. Free some space, or ask for less.")
        print(f"error: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(interrupted, file=sys.stderr)
        return 130


def exit_process(code: int) -> NoReturn:
    """Ends the process of a command with its exit code.

    If both Ray and TensorFlow are loaded, the interpreter sometimes crashes during shutdown after an interrupt. With Ray
    loaded, the process therefore exits at once and skips the interpreter's shutdown.

    Args:
        code: The exit code.
    """
    if "ray" not in sys.modules:
        sys.exit(code)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)
