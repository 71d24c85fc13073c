"""Runs one input and says what came of it: accepted, refused in one good line, or failed."""

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

MOST_SECONDS = 5.0
MOST_MIB = 1024


class TooLong(BaseException):
    """An input that hangs; no handler of the library catches it."""


@dataclasses.dataclass
class Outcome:
    """What came of one input.

    Args:
        verdict: accepted, refused, failed or unused.
        seconds: How long it took.
        why: The line of a refusal, or the end of a traceback.
    """

    verdict: str
    seconds: float
    why: str = ""


def _is_of_memory(error: BaseException | None) -> bool:
    """Whether memory that the limit did not give stands behind an error: what refuses in time never asks for it."""
    while error is not None and not isinstance(error, MemoryError):
        error = error.__context__
    return error is not None


def judge(run: Callable[[bytes, Path], None], data: bytes, folder: Path) -> Outcome:
    """Runs one input in an empty folder.

    Args:
        run: A target's function.
        data: The input.
        folder: Emptied before and made the working directory.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    before = os.getcwd()
    os.chdir(folder)
    signal.signal(signal.SIGALRM, _interrupt)
    signal.setitimer(signal.ITIMER_REAL, MOST_SECONDS)
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
        verdict, why = "failed", f"still running after {MOST_SECONDS} s"
    except BaseException as error:  # noqa: BLE001  every other error is what is looked for
        verdict, why = "failed", "".join(traceback.format_exception(error)[-12:])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        os.chdir(before)
    seconds = time.perf_counter() - began
    if seconds > MOST_SECONDS:
        verdict, why = "failed", f"{seconds:.1f} s"
    return Outcome(verdict, seconds, why)


def peak_mib() -> float:
    """The most memory that this process has had, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def limit_memory(more_mib: int) -> None:
    """Lets this process have so much more address space than it has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + more_mib * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _interrupt(number, frame):
    raise TooLong
