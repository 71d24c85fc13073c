"""Many channels at once: a folder of fitted simulators, one folder a channel, each fitted in a process of its own.

MODEL_DIR/volts/        what `EnhancedSimulator.save` writes, and
MODEL_DIR/volts/report.json, report.png
"""

import concurrent.futures
import contextlib
import dataclasses
import multiprocessing
import os
import signal
import threading
import urllib.parse
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.cleaning import Cleaning, clean
from enhsim_tf.errors import InputError
from enhsim_tf.files import encoded, make_folder, remove_leftovers, replace_folder, write_json
from enhsim_tf.saved_simulator import MANIFEST, is_foreign
from enhsim_tf.terminal import printable, start_tensorflow

if TYPE_CHECKING:
    import pandas as pd

_THREADS = 2  # of TensorFlow for each channel: how it adds up depends on their number, so that must not depend on the workers


@dataclasses.dataclass(frozen=True)
class Job:
    """One channel to be fitted.

    Args:
        channel: Its name.
        series: Its raw values, as `sources.read_source` reads them.
        folder: Where its simulator goes.
        options: `fitting.FitOptions` as a dictionary.
        cleaning: What to do with dirty values.
        verbose: Whether to show progress bars.
    """

    channel: str
    series: "pd.Series"
    folder: Path
    options: Mapping[str, Any]
    cleaning: Cleaning
    verbose: bool = False


def folder_of(models: str | os.PathLike, channel: str) -> Path:
    """The folder of a channel: its name, encoded.

    Raises:
        InputError: If no file can have the name.
    """
    return Path(models) / encoded(channel)


def models_of(models: str | os.PathLike) -> dict[str, Path]:
    """The fitted channels of a folder, by name; a saved simulator itself is one.

    Raises:
        InputError: If there is none.
    """
    models = Path(os.path.abspath(models))  # so that "." has a name too
    if os.path.isfile(models / MANIFEST):  # asked in this way, a name that no file can have is no error
        return {urllib.parse.unquote(models.name): models}
    folders = sorted(models.glob(f"[!.]*/{MANIFEST}")) if os.path.isdir(models) else []
    if not folders:
        raise InputError(
            f"Expected a folder of fitted simulators. Received: {printable(str(models))[:200]}, which holds none. Make one with `fit`."
        )
    return {urllib.parse.unquote(folder.parent.name): folder.parent for folder in folders}


def chosen_of(models: Mapping[str, Path], channels: Sequence[str] | None) -> dict[str, Path]:
    """The fitted channels that were named, or all.

    Args:
        models: Those of `models_of`.
        channels: Names, or None.

    Raises:
        InputError: If one of them is not there.
    """
    unknown = [name for name in channels or () if name not in models]
    if unknown:
        raise InputError(f"Expected --channel, one of: {printable(', '.join(list(models)[:8]))}. Received: {unknown[0]!r}.")
    return {name: models[name] for name in channels or models}


def refuse_foreign(folder: Path) -> None:
    """Refuses a folder that holds something else than a saved simulator.

    Raises:
        InputError: If it does.
    """
    if is_foreign(folder):
        raise InputError(f"Expected a folder for models. Received: {folder}, which holds something else. Name another --out.")


def fit_channels(
    series: Mapping[str, "pd.Series"],
    out: str | os.PathLike,
    options: Mapping[str, Any],
    cleaning: Cleaning,
    workers: int,
    tell: Callable[[str], None],
    verbose: bool = False,
) -> dict[str, str]:
    """Fits a simulator to each channel, writes it with its report, and tells what was found.

    Args:
        series: Raw channels by name.
        out: The folder of the models.
        options: Fields of `fitting.FitOptions`.
        cleaning: What to do with dirty values.
        workers: Channels fitted at a time, each in a process of its own. Their number changes no bit of the simulators.
            0 fits them in this process, with the threads that it has.
        tell: Called with each line.
        verbose: Whether to show progress bars, where one channel is fitted at a time.

    Returns:
        For each channel that could not be fitted, why.

    Raises:
        InputError: If a channel has no usable name, or something else stands where a simulator would go; before any is fitted.
    """
    out = make_folder(out)
    if (out / MANIFEST).is_file():
        raise InputError(f"Expected a folder for models. Received: {out}, which is a model itself. Name another --out, or the one above.")
    verbose = verbose and min(workers, len(series)) <= 1
    jobs = [Job(name, each, folder_of(out, name), dict(options), cleaning, verbose) for name, each in series.items()]
    for job in jobs:
        refuse_foreign(job.folder)
    remove_leftovers(out)
    if workers and jobs:
        return _fit_in_processes(jobs, workers, tell)
    failed: dict[str, str] = {}
    for job in jobs:
        try:
            tell("\n".join(fit_job(job)))
        except InputError as error:
            failed[job.channel] = str(error)
    return failed


def _fit_in_processes(jobs: list[Job], workers: int, tell: Callable[[str], None]) -> dict[str, str]:
    """Each channel in a process of its own; one that fails or is killed does not stop the others' results."""
    failed: dict[str, str] = {}
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # a forked TensorFlow hangs
    with concurrent.futures.ProcessPoolExecutor(min(workers, len(jobs)), context, _begin) as pool:
        with _ignored_interrupts():  # processes inherit it: at an interrupt they are ended below, without a word
            running = {pool.submit(fit_job, job): job for job in jobs}
        try:
            for done in concurrent.futures.as_completed(running):
                channel = running[done].channel
                try:
                    tell("\n".join(done.result()))
                except InputError as error:
                    failed[channel] = str(error)
                except BrokenProcessPool:
                    failed[channel] = "Expected to fit it in a process. Received: one that was killed, perhaps for memory. Use --workers 1."
        finally:
            if not all(future.done() for future in running):  # at an interrupt
                pool.shutdown(wait=False, cancel_futures=True)
                for child in set(multiprocessing.active_children()) - before:
                    child.terminate()
    return failed


def _begin() -> None:
    """Begins a process: its threads, before TensorFlow is imported."""
    os.environ["TF_NUM_INTRAOP_THREADS"] = str(_THREADS)


@contextlib.contextmanager
def _ignored_interrupts() -> Iterator[None]:
    """Ignores interrupts for a moment, where that can be chosen: in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def fit_job(job: Job) -> list[str]:
    """Cleans, fits and writes one channel, whole or not at all; returns the lines of its reports.

    Raises:
        InputError: If the channel cannot be used.
    """
    cleaned = clean(job.series, job.cleaning)
    start_tensorflow()
    from enhsim_tf.channel_figure import channel_figure
    from enhsim_tf.fitting import FitOptions, fit_channel

    parts = [dataclasses.replace(part, name=job.channel) for part in cleaned.parts]
    simulator, report = fit_channel(parts, FitOptions(**job.options), "auto" if job.verbose else 0)
    refuse_foreign(job.folder)  # it has been minutes
    with replace_folder(job.folder) as temporary:
        simulator.save(temporary)
        write_json(temporary / "report.json", {"realism": report.to_dict(), "cleaning": cleaned.report.to_dict()})
        channel_figure(report).savefig(temporary / "report.png", dpi=200, format="png")
    return [*cleaned.report.lines(), *report.lines(), f"simulator, report.json and report.png in {job.folder}/"]
