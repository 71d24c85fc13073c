"""Console output of the commands: printed lines, progress, and one-line error messages."""

import argparse
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import NoReturn

from enhsim_tf.common.errors import InputError, printable


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `InputError`, so that a wrong option ends in one line and exit
    code 2.
    """

    def error(self, message: str) -> NoReturn:
        """Raises an `InputError` for a command line that cannot be parsed."""
        missing = message.partition("arguments are required: ")[2]
        if missing:
            raise InputError(
                f"Expected {missing}. Received: no such argument. See {self.prog} --help."
            )
        raise InputError(
            f"Expected options as --help lists them. Received: {' '.join(message.split())}."
        )


_quiet: list[bool] = []  # not empty if only warnings are printed


def be_quiet(wanted: bool) -> None:
    """Says whether `tell` prints only warnings from now on."""
    _quiet[:] = [True] * wanted


def tell(line: str) -> None:
    """Prints a line at once, also through a pipe; what cannot be printed or encoded, for example in
    channel names, becomes a question mark. After `be_quiet`, only lines of warnings are printed.
    """
    if _quiet:
        line = "\n".join(part for part in line.split("\n") if "WARNING" in part)
        if not line:
            return
    text = "\n".join(printable(part) for part in line.split("\n"))
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    text = text.encode(encoding, "replace").decode(encoding)
    # text and line break in one write, since other processes may print at the same time
    print(f"{text}\n", end="", flush=True)


INTERVAL_S = 15.0  # seconds between two progress lines


class Progress:
    """Reports the progress of long work as lines of text, with which `tell` is called; each begins
    with `before`.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        before: str = "",
        clock: Callable[[], float] = time.monotonic,
    ):
        self.tell = tell
        self.before = before
        self.clock = clock
        self.last_line_s = clock()

    def step(self, what: str) -> None:
        """Says at once what begins, such as `noise`."""
        self.last_line_s = self.clock()
        self.tell(f"{self.before}{what} ...")

    def loop(self, unit: str, total: int) -> Callable[[float], None]:
        """Starts to report a loop, by a line when `INTERVAL_S` seconds have passed since the last
        one.

        Returns:
            A function to be called with the number of finished units, such as epochs, which may be
            fractional.
        """
        began = self.clock()

        def told(done: float) -> None:
            now = self.clock()
            if 0 < done < total and now - self.last_line_s >= INTERVAL_S:
                self.last_line_s = now
                left = _time_left((now - began) / done * (total - done))
                self.tell(
                    f"{self.before}{unit} {math.ceil(done):,} of {total:,}, "
                    f"{math.floor(100 * done / total)} %, {left}"
                )

        return told


SILENT = Progress(lambda line: None)


def _time_left(seconds: float) -> str:
    if seconds < 120:
        return f"about {max(1, round(seconds))} s left"
    return (
        f"about {round(seconds / 60)} min left"
        if seconds < 7_200
        else f"about {seconds / 3_600:.1f} h left"
    )


def run_command(run: Callable[[], int], interrupted: str) -> int:
    """Runs a command, a function that returns the exit code, and prints its error as one line, or
    the words for an interrupt.

    A signal to terminate, as `timeout` and `docker stop` send it, is treated as an interrupt.

    Returns:
        The exit code: 2 for a user's mistake and for errors of files or memory; as in shells, 130
        for an interrupt and 141 for a closed output pipe.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return run()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  Python flushes stdout again at exit
        return 141
    except (OSError, MemoryError) as error:
        reason = " ".join(str(error).splitlines())[:300] or "too little memory"
        line = InputError(
            f"Expected enough memory and files that can be used. Received: {reason}. Free some "
            "space, or ask for less."
        )
        print(f"error: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(interrupted, file=sys.stderr)
        return 130
