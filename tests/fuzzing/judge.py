"""Runs one input and classifies the outcome: accepted, refused with a well-formed error, or failed."""

import contextlib
import dataclasses
import io
import os
import resource
import shutil
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.errors import InputError
from tests.fuzzing.target import UnusedError, is_good

MAX_SECONDS = 5.0
MAX_MIB = 1024


class TooLong(BaseException):
    """Raised for an input that takes too long. It is a BaseException, so that the package does not catch it."""


@dataclasses.dataclass
class Outcome:
    """The outcome of one input.

    Args:
        verdict: "accepted", "refused", "failed" or "unused".
        seconds: Run time in seconds.
        why: The error message of a refusal, or the end of a traceback.
    """

    verdict: str
    seconds: float
    why: str = ""


def _is_of_memory(error: BaseException | None) -> bool:
    """Whether an error was caused by a MemoryError. Input that is refused in time never allocates that much."""
    while error is not None and not isinstance(error, MemoryError):
        error = error.__context__
    return error is not None


def judge(run: Callable[[bytes, Path], None], data: bytes, folder: Path) -> Outcome:
    """Runs one input in an empty folder.

    Args:
        run: A target's function.
        data: The input.
        folder: Working directory of the target. It is emptied first.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    before = os.getcwd()
    os.chdir(folder)
    signal.signal(signal.SIGALRM, _interrupt)
    signal.setitimer(signal.ITIMER_REAL, MAX_SECONDS)
    began = time.perf_counter()
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", UserWarning)  # as in all tests
            run(data, folder)
        verdict, why = "accepted", ""
    except InputError as error:
        why = str(error)
        verdict = "refused" if is_good(why) and not _is_of_memory(error) else "failed"
    except UnusedError:
        verdict, why = "unused", ""
    except TooLong:
        verdict, why = "failed", f"still running after {MAX_SECONDS} s"
    except BaseException as error:  # noqa: BLE001  any other exception is a failure
        verdict, why = "failed", "".join(traceback.format_exception(error)[-12:])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        os.chdir(before)
    seconds = time.perf_counter() - began
    if seconds > MAX_SECONDS:
        verdict, why = "failed", f"{seconds:.1f} s"
    return Outcome(verdict, seconds, why)


def peak_mib() -> float:
    """Peak memory of this process in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def limit_memory(more_mib: int) -> None:
    """Limits the address space of this process to the current size plus the given amount."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + more_mib * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _interrupt(number, frame):
    raise TooLong
