"""How the commands speak: one line for a user's mistake, nothing of what others write to the terminal."""

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
    """A parser whose refusals are those of the whole command: one line, exit code 2."""

    def error(self, message: str) -> NoReturn:
        """Refuses the command line."""
        missing = message.partition("arguments are required: ")[2]
        if missing:
            raise InputError(f"Expected {missing}. Received: no such argument. See {self.prog} --help.")
        raise InputError(f"Expected options as --help lists them. Received: {' '.join(message.split())}.")


def tell(line: str) -> None:
    """Prints a line, or some, at once, so that whoever waits or reads through a pipe sees it.

    Args:
        line: Names of channels and folders in it may hold anything.
    """
    text, encoding = "\n".join(printable(each) for each in line.split("\n")), getattr(sys.stdout, "encoding", None) or "utf-8"
    text = text.encode(encoding, "replace").decode(encoding)  # a narrow terminal shows what it can
    print(f"{text}\n", end="", flush=True)  # in one piece with its end: other processes may write lines of theirs meanwhile


def progress(*arguments: Any, **options: Any) -> "tqdm":
    """A bar of `tqdm`, which is of this process alone.

    Its own lock would be shared between processes by a semaphore; of a process of a pool that is ended in the middle, Python
    then tells the user that one was leaked.

    Args:
        *arguments: Those of `tqdm`.
        **options: Those of `tqdm`.
    """
    from tqdm import tqdm

    if not hasattr(tqdm, "_lock"):
        tqdm.set_lock(threading.RLock())
    return tqdm(*arguments, **options)


INTERVAL_S = 15.0  # seconds without a word, after which a run without a terminal says how far it is


class Progress:
    """How far long work is, told in lines where no terminal shows bars: one whenever `INTERVAL_S` have passed without any.

    Args:
        tell: Called with each line. None: nothing is told.
        before: What each line begins with: the name of the work.
        clock: Seconds that only rise.
    """

    def __init__(self, tell: Callable[[str], None] | None = None, before: str = "", clock: Callable[[], float] = time.monotonic):
        self.tell, self.before, self.clock, self.told = tell, before, clock, clock()

    def loop(self, unit: str, total: int) -> "Loop":
        """A loop that begins now.

        Args:
            unit: What is counted, such as `epoch`.
            total: How many there will be.
        """
        return Loop(self, unit, total)


class Loop:
    """A loop of long work, called with how many of its units are done; the one under way may be done in part.

    How long the rest takes is judged by all steps but the first, which builds the graph of a network.

    Args:
        progress: Whose lines tell of it.
        unit: What is counted.
        total: How many there will be.
    """

    def __init__(self, progress: Progress, unit: str, total: int):
        self.progress, self.unit, self.total = progress, unit, total
        self.first: tuple[float, float] | None = None  # when the first step ended, and what was done then

    def __call__(self, done: float) -> None:
        """Tells a line if it is time for one: 6.2 done of 40 are in number 7."""
        if self.progress.tell is None or not 0 < done < self.total:
            return
        now = self.progress.clock()
        self.first = self.first or (now, done)
        if now - self.progress.told < INTERVAL_S:
            return
        self.progress.told = now
        line = f"{self.progress.before}{self.unit} {math.ceil(done):,} of {self.total:,}, {math.floor(100 * done / self.total)} %"
        began, before = self.first
        if done > before:
            line += f", {time_left((now - began) / (done - before) * (self.total - done))}"
        self.progress.tell(line)

    def within(self, before: int, steps: int = 1) -> Callable[[float], None]:
        """What is called with the steps that are done of one unit, or of some where a unit is a step.

        Args:
            before: Units that were done before.
            steps: Steps of a unit.
        """
        return lambda done: self(before + done / steps)


SILENT = Progress()


def time_left(seconds: float) -> str:
    """About how long something will still take, in words."""
    if seconds < 120:
        return f"about {max(1, round(seconds))} s left"
    return f"about {round(seconds / 60)} min left" if seconds < 7_200 else f"about {seconds / 3_600:.1f} h left"


def run_command(run: Callable[[], int], interrupted: str) -> int:
    """Runs a command and returns its exit code.

    It is 2 with one line for a user's mistake and for what the machine refuses, 130 for an interrupt, and 141, as a shell
    has it, where whoever read the output has left.

    Args:
        run: The command; returns its exit code.
        interrupted: What to say of an interrupt.
    """
    try:
        return run()
    except InputError as error:
        print(f"error: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  Python flushes it once more at its end
        return 141
    except (OSError, MemoryError) as error:
        reason = " ".join(str(error).splitlines())[:300] or "more than there is"
        line = InputError(f"Expected files and memory as they are needed. Received: {reason}. Make room, or ask for less.")
        print(f"error: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(interrupted, file=sys.stderr)
        return 130


def exit_process(code: int) -> NoReturn:
    """Ends the process of a command with its exit code.

    Ray, beside TensorFlow and after an interrupt, now and then crashes a process that Python is taking down, when all is
    said and done. Where Ray was loaded the process therefore ends at once.

    Args:
        code: The exit code.
    """
    if "ray" not in sys.modules:
        sys.exit(code)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)
