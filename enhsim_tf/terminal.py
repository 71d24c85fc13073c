"""How the commands speak: one line for a user's mistake, nothing of what others write to the terminal."""

import argparse
import gc
import os
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from enhsim_tf.errors import InputError, printable

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
    print(text.encode(encoding, "replace").decode(encoding), flush=True)  # a narrow terminal shows what it can


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


def finish(run: Callable[[], int], interrupted: str) -> int:
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


def leave(code: int) -> NoReturn:
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


def start_tensorflow() -> None:
    """Imports TensorFlow without the notes about drivers and kernels that it writes to standard error.

    They are written before any of its own log levels counts, so the file descriptor itself is turned away meanwhile. An
    import that fails still raises. The garbage collector rests meanwhile: walking over all that is imported, which stays,
    takes a quarter of the time.
    """
    if "tensorflow" in sys.modules:
        return
    collects = gc.isenabled()
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        gc.disable()
        import tensorflow as tf

        tf.get_logger().setLevel("ERROR")  # its warnings are about how often a graph is built, and name no remedy a user has
        tf.config.list_physical_devices()  # the notes about devices come with the first look at them
    finally:
        if collects:
            gc.enable()
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
