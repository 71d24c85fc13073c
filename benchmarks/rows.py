"""The rows of the benchmark table: the compared implementations, the number of repetitions, and the target for each ratio.

The compared implementations alternate, so that a change in the speed of the machine affects all of them. Each ratio is computed
from two consecutive measurements. The table reports the median and the range of the ratios.
"""

import dataclasses
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.machine import has_avx512
from benchmarks.worker import Worker

PARAMETERS = 13_697_400
TRAFFIC = (
    10 * 4 * PARAMETERS
)  # bytes for each step: weights are read twice, gradients written once; Adam reads four arrays and writes three
MOST_FAULTS = 2_000_000  # maximum number of minor page faults of a full reproduction
WINDOW_FLOP = 2 * (500 * 500 + 500 * 3_200 + 3_200 * 3_200 + 3_200 * 500)  # operations of the enhancer for one window


@dataclasses.dataclass(frozen=True)
class Budget:
    """Numbers of repetitions and sizes, for a full measurement or for a quick run that only shows that everything works."""

    repetitions: int = 7
    steps: int = 40
    iterations: int = 5
    textbook_iterations: int = 3
    windows: int = 4_096
    sizes: tuple[int, ...] = (100, 1_000, 10_000, 100_000, 1_000_000)
    lengths: tuple[int, ...] = (125, 250, 500, 1_000, 2_000)
    size: dict = dataclasses.field(default_factory=dict)  # size of the networks, if it differs from the paper's
    gan_size: dict = dataclasses.field(default_factory=dict)


QUICK = Budget(2, 2, 1, 1, 64, (10, 40), (125, 250), {"window": 125, "hidden_units": 32}, {"window": 125, "filters": 8})


def spread(values: list[float]) -> dict[str, float]:
    """Returns the median and the range of values."""
    return {"median": float(np.median(values)), "low": float(min(values)), "high": float(max(values))}


def in_turns(ways: dict[str, Callable[[], float]], repetitions: int) -> dict[str, list[float]]:
    """Calls the functions alternately, and returns the results of each."""
    found = {name: [] for name in ways}
    for repetition in range(repetitions):
        for name in list(ways)[:: 1 if repetition % 2 else -1]:  # reverses the order each time, so that none always follows the same other
            found[name].append(ways[name]())
    return found


@dataclasses.dataclass(frozen=True)
class Turns:
    """Measurements of workers that alternated, by the name of the implementation.

    Args:
        seconds: Seconds for each unit of work, one number for each repetition.
        peaks: Peak memory in MB.
        faults: Minor page faults for each unit of work, median over the repetitions.
        skipped: Reasons why implementations were skipped.
    """

    seconds: dict[str, list[float]]
    peaks: dict[str, float]
    faults: dict[str, float]
    skipped: dict[str, str]

    def compare(self, work: str, comparison: str, unit: str, bar: float | None, ours: str = "ours", words: str | None = None) -> dict:
        """Returns the row of a comparison, which may have been skipped."""
        words = words or comparison
        if comparison in self.skipped:
            return {"work": work, "comparison": words, "skipped": self.skipped[comparison], "unit": unit, "bar": bar}
        more = {"peak_mb": self.peaks[ours], "their_peak_mb": self.peaks[comparison]}
        more |= {"faults": self.faults[ours], "their_faults": self.faults[comparison]}
        return compared(work, self.seconds[ours], words, self.seconds[comparison], unit, bar, **more)

    def limited(self, work: str, comparison: str, limit: str, units: float, bar: float | None, ours: str = "ours", **about: object) -> dict:
        """Returns the row of a comparison with a limit of the machine, which was measured for one byte or one operation."""
        floor = [units * each for each in self.seconds[limit]]
        more = {"peak_mb": self.peaks[ours], "faults": self.faults[ours]}
        return compared(work, self.seconds[ours], comparison, floor, "ms", bar, limit=about, **more)


def workers_in_turns(workers: dict[str, Worker], repetitions: int) -> Turns:
    """Lets the workers repeat their work alternately."""
    skipped = {name: worker.skipped for name, worker in workers.items() if worker.skipped}
    seconds = in_turns({name: worker.repeat for name, worker in workers.items() if name not in skipped}, repetitions)
    peaks = {name: workers[name].close() for name in seconds}
    return Turns(seconds, peaks, {name: float(np.median(workers[name].faults)) for name in seconds}, skipped)


def compared(work: str, ours: list[float], comparison: str, theirs: list[float] | None, unit: str, bar: float | None, **more) -> dict:
    """Returns a row: the times in ms or s, the ratio of enhsim_tf to the comparison, and whether it is at most the target."""
    factor = {"ms": 1e3, "s": 1.0}[unit]
    row = {"work": work, "unit": unit, "ours": spread([factor * each for each in ours]), "comparison": comparison}
    if theirs is not None:
        ratio = spread([mine / other for mine, other in zip(ours, theirs, strict=True)])
        row |= {"theirs": spread([factor * each for each in theirs]), "ratio": ratio, "bar": bar}
        row["reached"] = None if bar is None else ratio["median"] <= bar
    return row | more


def enhancer(budget: Budget) -> Iterator[dict]:
    """Benchmarks a training step of the enhancer."""
    given = {"num_steps": budget.steps, **budget.size}
    workers = {
        "ours": Worker("ours", "enhancer_step", **given),
        "plain fit": Worker("keras_plain", "enhancer_step", **given),
        "PyTorch, fused Adam": Worker("torch_enhancer", "enhancer_step", **given),
        "floor": Worker("ours", "copy", num_bytes=TRAFFIC if not budget.size else 10_000),
    }
    found = workers_in_turns(workers, budget.repetitions)
    for name, bar in (("plain fit", 0.7), ("PyTorch, fused Adam", 0.7)):
        yield found.compare("enhancer step", name, "ms", bar)
    rate = spread([1e-9 / each for each in found.seconds["floor"]])
    yield found.limited("enhancer step", "memory-traffic floor", "floor", TRAFFIC, 1.3, copy_gb_s=rate, bytes=TRAFFIC)


def gan(budget: Budget) -> Iterator[dict]:
    """Benchmarks an iteration of the paper's GAN, with and without dropout."""
    for dropout, bars in ((0.0, (0.25, 0.65)), (0.3, (0.5, None))):
        given = {"num_iterations": budget.iterations, "dropout": dropout, **budget.gan_size}
        workers = {
            "ours": Worker("ours", "gan_iteration", **given),
            "textbook loop": Worker("textbook_gan", "gan_iteration", **(given | {"num_iterations": budget.textbook_iterations})),
            "one tf.function": Worker("keras_plain", "gan_iteration", **given),
        }
        found = workers_in_turns(workers, budget.repetitions)
        work = "GAN iteration" + (", dropout 0.3" if dropout else "")
        for name, bar in zip(("textbook loop", "one tf.function"), bars, strict=True):
            yield found.compare(work, name, "ms", bar)


def second(budget: Budget) -> Iterator[dict]:
    """Benchmarks an iteration of the convolutional GAN and of the autoregressive network against one of the paper's GAN."""
    given = {"num_iterations": budget.iterations}
    window = {name: value for name, value in budget.gan_size.items() if name == "window"}
    workers = {
        "ours": Worker("ours", "convolutional_iteration", **given, **window),
        "network": Worker("ours", "network_iteration", **given, **window),
        "the paper's": Worker("ours", "gan_iteration", **given, **budget.gan_size),
    }
    found = workers_in_turns(workers, budget.repetitions)
    words = "the paper's networks, same package"
    yield found.compare("GAN iteration, second generator", "the paper's", "ms", 1.5, words=words)
    yield found.compare("iteration, autoregressive network of noise", "the paper's", "ms", 3.0, ours="network", words=words)


def generation(budget: Budget) -> Iterator[dict]:
    """Benchmarks the generation of windows in memory and to Parquet, in milliseconds for each window."""
    given = {"num_windows": budget.windows, **budget.size}
    workers = {name: Worker("ours", name, **given) for name in ("enhance_and_noise", "generate", "generate_to_parquet")}
    workers |= {"predict": Worker("keras_plain", "enhance_and_noise", **given), "product": Worker("ours", "matrix_product")}
    found = workers_in_turns(workers, budget.repetitions)
    limit = {"gflop_s": spread([1e-9 / each for each in found.seconds["product"]]), "flop": WINDOW_FLOP}
    name = "generation of a window, enhancer + noise"
    yield found.limited(name, "matrix-product rate", "product", WINDOW_FLOP, 1 / 0.8, "enhance_and_noise", **limit)
    yield found.compare(name, "predict", "ms", None, "enhance_and_noise", "Keras' predict")
    name = "generation of a window, coarse simulator included"
    yield found.limited(name, "matrix-product rate", "product", WINDOW_FLOP, None, "generate", **limit)
    name = "generation of a window to Parquet"
    yield found.compare(name, "generate", "ms", 1 / 0.6, "generate_to_parquet", "generation in memory")


def loading(budget: Budget) -> Iterator[dict]:
    """Benchmarks the loading of a saved simulator."""
    workers = {name: Worker("ours", name, **budget.size) for name in ("load_simulator", "load_networks")}
    found = workers_in_turns(workers, budget.repetitions)
    yield found.compare("loading a simulator", "load_networks", "s", None, "load_simulator", "load_model, three files")


def starting(budget: Budget) -> Iterator[dict]:
    """Benchmarks the start of commands that need no network."""

    def timed(*arguments: str) -> Callable[[], float]:
        def run() -> float:
            began = time.perf_counter()
            subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
            return time.perf_counter() - began

        return run

    command = ("-m", "enhsim_tf.reproduce")
    ways = {
        "--help": timed(*command, "--help"),
        "an argument error": timed(*command, "--only", "fig99"),
        "import enhsim_tf": timed("-c", "import enhsim_tf"),
        "nothing": timed("-c", "pass"),
        "import tensorflow": timed("-c", "import tensorflow"),
    }
    found = in_turns(ways, budget.repetitions)
    for name in ("--help", "an argument error", "import enhsim_tf"):
        row = compared(name, found[name], "import tensorflow", found["import tensorflow"], "s", None)
        yield row | {"bar_s": 0.5, "reached": row["ours"]["median"] < 0.5, "python_s": spread(found["nothing"])}


def growth(budget: Budget) -> Iterator[dict]:
    """Measures time and memory of generation against the number of windows, and of training against the window length."""
    windows = []
    for number in budget.sizes:
        worker = Worker("ours", "generate_any", **budget.size)
        seconds = worker.repeat(number)
        windows.append({"num_windows": number, "seconds": seconds, "peak_mb": worker.close()})
    yield {"work": "generation to Parquet against the number of windows", "growth": windows, "x": "num_windows"}
    lengths = []
    for length in budget.lengths:
        hidden = budget.size.get("hidden_units", 3_200)
        filters = budget.gan_size.get("filters", 500)
        workers = {
            "enhancer": Worker("ours", "enhancer_step", num_steps=max(2, budget.steps // 4), window=length, hidden_units=hidden),
            "GAN": Worker("ours", "gan_iteration", num_iterations=budget.iterations, window=length, filters=filters),
        }
        found = workers_in_turns(workers, min(3, budget.repetitions))
        times, peaks = {name: 1e3 * float(np.median(each)) for name, each in found.seconds.items()}, found.peaks
        lengths.append({"window": length, "enhancer_ms": times["enhancer"], "gan_ms": times["GAN"], "peak_mb": peaks})
    yield {"work": "training against the length of a window", "growth": lengths, "x": "window"}


def reproduce(budget: Budget) -> Iterator[dict]:
    """Measures the time and the page faults of a full reproduction in a separate process, without cached stages."""
    with tempfile.TemporaryDirectory() as folder:
        out, cache = os.path.join(folder, "figures"), os.path.join(folder, "cache")
        command = [sys.executable, "-m", "enhsim_tf.reproduce", "--out", out, "--cache", cache]
        began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        smoke = ["--budget", "smoke"] if budget.size else []
        done = subprocess.run([*command, *smoke], stdout=subprocess.DEVNULL, env=os.environ | Worker.processor, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):  # exit code 1 means that a verdict changed
        raise RuntimeError(f"Expected a run of reproduce. Received: exit code {done.returncode}.")
    faults = after.ru_minflt - before.ru_minflt
    yield {
        "work": "a full reproduce, minor page faults",
        "comparison": "a bar in faults",
        "seconds": time.perf_counter() - began,
        "user_s": after.ru_utime - before.ru_utime,
        "system_s": after.ru_stime - before.ru_stime,
        "faults": faults,
        "bar_faults": MOST_FAULTS,
        "reached": faults <= MOST_FAULTS,
    }


def bar_of_reproduction(about: dict) -> float:
    """Returns the target for a machine. It is stricter without AVX-512, where plain Keras uses TensorFlow's slower kernels."""
    return 0.33 if has_avx512(about) and not about.get("as_without_avx512") else 0.18


def reproduction(rows: list[dict], bar: float = 0.33) -> Iterator[dict]:
    """Estimates the training time of a full reproduction from the measured steps, because a full textbook run takes too long.

    Args:
        rows: The measured rows.
        bar: Target for the ratio, see `bar_of_reproduction`.
    """
    found = {(row["work"], row.get("comparison")): row for row in rows}
    enhancing, judging = found.get(("enhancer step", "plain fit"), {}), found.get(("GAN iteration", "textbook loop"), {})
    if "ratio" in enhancing and "ratio" in judging:
        seconds = {
            side: {key: 4.0 * enhancing[side][key] + 1.0 * judging[side][key] for key in ("median", "low", "high")}
            for side in ("ours", "theirs")
        }
        ratio = {"median": seconds["ours"]["median"] / seconds["theirs"]["median"]}
        # the extremes of the two ratios, weighed by the comparison's share of time
        weight = 4.0 * enhancing["theirs"]["median"] / seconds["theirs"]["median"]
        for key in ("low", "high"):
            ratio[key] = weight * enhancing["ratio"][key] + (1 - weight) * judging["ratio"][key]
        yield {
            "work": "training of a full reproduce, composed from the steps above",
            "comparison": "plain fit and textbook loop",
            "unit": "s",
            **seconds,
            "ratio": ratio,
            "bar": bar,
            "reached": ratio["median"] <= bar,
            "note": "composed: 40 epochs of 100 steps and 1,000 iterations at the measured medians",
        }


ROWS = {
    "enhancer": enhancer,
    "gan": gan,
    "second": second,
    "generation": generation,
    "loading": loading,
    "starting": starting,
    "growth": growth,
    "reproduce": reproduce,
}
