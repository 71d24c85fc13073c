"""Many channels at once: a folder of fitted simulators, one folder a channel, each fitted in a process of its own.

MODEL_DIR/volts/        what `EnhancedSimulator.save` writes, and
MODEL_DIR/volts/report.json, report.png
"""

import concurrent.futures
import dataclasses
import multiprocessing
import os
import urllib.parse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.cleaning import Cleaning, clean
from enhsim_tf.errors import InputError
from enhsim_tf.files import make_folder, replace_file, write_json
from enhsim_tf.terminal import start_tensorflow

if TYPE_CHECKING:
    import pandas as pd

MANIFEST = "manifest.json"  # by it a folder is known as a saved simulator


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
    """The folder of a channel: its name, percent-encoded so that no name can leave the folder or hide in it."""
    return Path(models) / urllib.parse.quote(channel, safe=" ").replace(".", "%2E")


def models_of(models: str | os.PathLike) -> dict[str, Path]:
    """The fitted channels of a folder, by name; a saved simulator itself is one.

    Raises:
        InputError: If there is none.
    """
    models = Path(models)
    if (models / MANIFEST).is_file():
        return {urllib.parse.unquote(models.name): models}
    folders = sorted(models.glob(f"[!.]*/{MANIFEST}")) if models.is_dir() else []
    if not folders:
        raise InputError(f"Expected a folder of fitted simulators. Received: {models}, which holds none. Make one with `fit`.")
    return {urllib.parse.unquote(folder.parent.name): folder.parent for folder in folders}


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
        workers: Channels fitted at a time, each in a process of its own; 1 fits them here.
        tell: Called with each line.
        verbose: Whether to show progress bars, with one worker.

    Returns:
        For each channel that could not be fitted, why.
    """
    out = make_folder(out)
    for name in series:
        existing = folder_of(out, name)
        if existing.exists() and not (existing / MANIFEST).is_file():
            raise InputError(f"Expected a folder for models. Received: {existing}, which holds something else. Name another --out.")
    jobs = [Job(name, each, folder_of(out, name), dict(options), cleaning, verbose) for name, each in series.items()]
    failed: dict[str, str] = {}
    if min(workers, len(jobs)) <= 1:
        for job in jobs:
            try:
                lines = fit_job(job)
            except InputError as error:
                failed[job.channel] = str(error)
            else:
                tell("\n".join(lines))
        return failed
    threads = str(max(1, (os.cpu_count() or 1) // workers))
    context = multiprocessing.get_context("spawn")  # a forked TensorFlow hangs
    with concurrent.futures.ProcessPoolExecutor(workers, context, _set_threads, (threads,)) as pool:
        running = {pool.submit(fit_job, job): job for job in jobs}
        try:
            for done in concurrent.futures.as_completed(running):
                try:
                    tell("\n".join(done.result()))
                except InputError as error:
                    failed[running[done].channel] = str(error)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return failed


def _set_threads(threads: str) -> None:
    os.environ |= {"TF_NUM_INTRAOP_THREADS": threads, "OMP_NUM_THREADS": threads}


def fit_job(job: Job) -> list[str]:
    """Cleans, fits and writes one channel; returns the lines of its reports.

    Raises:
        InputError: If the channel cannot be used.
    """
    cleaned = clean(job.series, job.cleaning)
    start_tensorflow()
    from enhsim_tf.channel_figure import channel_figure
    from enhsim_tf.fitting import FitOptions, fit_channel

    parts = [dataclasses.replace(part, name=job.channel) for part in cleaned.parts]
    simulator, report = fit_channel(parts, FitOptions(**job.options), "auto" if job.verbose else 0)
    simulator.save(job.folder)
    write_json(job.folder / "report.json", {"realism": report.to_dict(), "cleaning": cleaned.report.to_dict()})
    with replace_file(job.folder / "report.png") as temporary:
        channel_figure(report).savefig(temporary, dpi=200, format="png")
    return [*cleaned.report.lines(), *report.lines(), f"simulator, report.json and report.png in {job.folder}/"]
