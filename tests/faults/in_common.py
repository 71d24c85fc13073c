"""Shared parts of the fault injection: the folder of the tries, and faults that apply to every command."""

import abc
import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.datasets.test_generate import children_of

ROOT = Path(__file__).parents[2]
MISSED = "too early or late"  # prefix of the outcome of a try that hit no running process; it does not count and is repeated


class Bench(abc.ABC):
    """A folder for tries, with the results of an undisturbed run. Each try has a name and a folder of that name."""

    same: str  # description of what must be equal after a recovery
    disks = (".",)  # folders of a try, one of which, chosen at random, gets a separate small file system

    def __init__(self, folder):
        self.folder = folder
        began = time.monotonic()
        code, _, err = self.ran("undisturbed")
        if code:
            raise SystemExit(f"the undisturbed run failed: {err}")
        self.seconds = time.monotonic() - began

    @abc.abstractmethod
    def command(self, name):
        """The arguments of `python` that run the command."""

    @abc.abstractmethod
    def wrong(self, name):
        """Describes what is wrong with the results of a run; None if they are correct."""

    def start(self, name, *options, **how):
        how = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True} | how
        return subprocess.Popen(list(map(str, [sys.executable, *self.command(name), *options])), **how)

    def ran(self, name, *options, **how):
        """Runs the command to its end; returns the exit code, the output and the errors."""
        process = self.start(name, *options, **how)
        out, err = process.communicate()
        return process.returncode, out, err

    def moment(self, rng):
        """Waits for a random moment of a run."""
        time.sleep(rng.uniform(0.02, 0.95) * self.seconds)

    def again(self, name):
        """Runs the same command again and describes what is wrong with its exit code or results; None if nothing is."""
        code, _, err = self.ran(name)
        return f"NOT recovered: {code} {err.strip()[-200:]}" if code or err else self.wrong(name)

    def recovered(self, name):
        """Runs the same command again and returns the outcome of the try. If it recovered, the folder of the try is removed."""
        wrong = self.again(name)
        if wrong is None:
            shutil.rmtree(self.folder / name)
        return wrong or f"recovered, {self.same}"


def not_one_line(code, err, expected=2):
    """Describes what is wrong with the way a command failed; None if it ended with the expected code and one line."""
    begins = "error: " if expected == 2 else "interrupted"
    one_line = code == expected and len(err.splitlines()) == 1 and err.startswith(begins)
    return None if one_line else f"NOT one line: {code} {err.strip()[-300:]}"


def kill(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    was_running = process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate()
    return ("" if was_running else f"{MISSED}; ") + bench.recovered(name)


def interrupt(bench, name, rng):
    process = bench.start(name)
    bench.moment(rng)
    os.killpg(process.pid, signal.SIGINT)
    err = process.communicate()[1]
    if process.returncode == 0:
        return f"{MISSED}; {bench.recovered(name)}"
    return not_one_line(process.returncode, err, expected=130) or f"one line; {bench.recovered(name)}"


@contextlib.contextmanager
def small_disk(folder, size):
    """Mounts a file system of this size, in kilobytes, on a folder; yields whether this succeeded, and unmounts it at the end."""
    folder.mkdir(parents=True, exist_ok=True)
    mounted = not subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", folder], capture_output=True).returncode
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", folder], check=True)


NOT_MOUNTED = "not tried: no file system can be mounted here"


def full_disk(bench, name, rng):
    """Lets the file system fill up while the command writes. It is enlarged afterwards."""
    total = sum(path.stat().st_size for path in (bench.folder / "undisturbed").rglob("*")) // 1024
    place = bench.folder / name
    with small_disk(place, int(rng.uniform(0.001, 0.99) * total)) as mounted:
        if not mounted:
            return NOT_MOUNTED
        code, _, err = bench.ran(name)
        if wrong := not_one_line(code, err):
            return wrong
        subprocess.run(["mount", "-o", f"remount,size={10 * total}k", place], check=True)
        wrong = bench.again(name)
    shutil.rmtree(place)
    return wrong or f"one line; recovered, {bench.same}"


def read_only(bench, name, rng):
    """Makes a folder read-only after a run was killed at a random moment. It is writable again afterwards."""
    which = bench.disks[rng.integers(len(bench.disks))]
    place = bench.folder / name / which
    with small_disk(place, 1_000_000) as mounted:
        if not mounted:
            return NOT_MOUNTED
        process = bench.start(name)
        bench.moment(rng)
        workers = children_of(process)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        while any(Path(f"/proc/{worker}").exists() for worker in workers):  # workers may still have files open
            time.sleep(0.01)
        subprocess.run(["mount", "-o", "remount,ro", place], check=True)
        code, _, err = bench.ran(name)
        subprocess.run(["mount", "-o", "remount,rw", place], check=True)
        wrong = not_one_line(code, err) or bench.again(name)
    shutil.rmtree(bench.folder / name)
    return wrong or f"one line{f' ({which})' if len(bench.disks) > 1 else ''}; recovered, {bench.same}"
