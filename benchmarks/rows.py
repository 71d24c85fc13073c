"""The rows of the benchmark table: the compared implementations, the number of repetitions, and the
target for each ratio.

The compared implementations alternate, so that a change in the speed of the machine affects all of
them. Each ratio is computed from two consecutive measurements. The table reports the median and the
range of the ratios.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from benchmarks.worker import Worker

REPETITIONS = 7
# inputs and outputs of each layer of the enhancer
LAYERS = ((500, 500), (500, 3_200), (3_200, 3_200), (3_200, 500))
PARAMETERS = sum(inputs * outputs + outputs for inputs, outputs in LAYERS)
# bytes of a step: weights are read twice, gradients written once; Adam reads four arrays and writes
# three
TRAFFIC = 10 * 4 * PARAMETERS
# operations of the enhancer for one window
WINDOW_FLOP = 2 * sum(inputs * outputs for inputs, outputs in LAYERS)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Returns the median and the range of values."""
    return {
        "median": float(np.median(values)),
        "low": float(min(values)),
        "high": float(max(values)),
    }


def in_turns(ways: Mapping[str, Callable[[], float]], repetitions: int) -> dict[str, list[float]]:
    """Calls the functions alternately, and returns the results of each."""
    found = {name: [] for name in ways}
    for repetition in range(repetitions):
        # reverses the order each time, so that none always follows the same other
        for name in list(ways)[:: 1 if repetition % 2 else -1]:
            found[name].append(ways[name]())
    return found


def compared(
    work: str,
    ours: Sequence[float],
    comparison: str,
    theirs: Sequence[float],
    unit: str = "ms",
    target: float | None = None,
) -> dict:
    """Returns a row from seconds of ours and of a comparison, one for each repetition, and a target
    for the median ratio, if there is one.
    """
    factor = {"ms": 1e3, "s": 1.0}[unit]
    return {
        "work": work,
        "unit": unit,
        "ours": spread([factor * each for each in ours]),
        "comparison": comparison,
        "theirs": spread([factor * each for each in theirs]),
        "ratio": spread([mine / other for mine, other in zip(ours, theirs, strict=True)]),
        "target": target,
    }


def measure(workers: Mapping[str, Worker]) -> dict[str, list[float]]:
    """Lets the workers repeat their work alternately; those that are skipped have no times."""
    ways = {name: worker.repeat for name, worker in workers.items() if not worker.skipped}
    found = in_turns(ways, REPETITIONS)
    for worker in workers.values():
        worker.close()
    return found


def enhancer() -> Iterator[dict]:
    """Benchmarks a training step of the enhancer."""
    given, work = {"num_steps": 40}, "enhancer step"
    workers = {
        "ours": Worker("ours", "enhancer_step", **given),
        "plain fit": Worker("keras_plain", "enhancer_step", **given),
        "PyTorch, fused Adam": Worker("torch_enhancer", "enhancer_step", **given),
        "floor": Worker("examples", "copy", num_bytes=TRAFFIC),
    }
    found = measure(workers)
    for name in ("plain fit", "PyTorch, fused Adam"):
        yield _row(work, workers, found, name, 0.7)
    yield compared(
        work,
        found["ours"],
        "memory-traffic estimate",
        [TRAFFIC * each for each in found["floor"]],
        target=1.3,
    )


def gan() -> Iterator[dict]:
    """Benchmarks an iteration of the paper's GAN, with and without dropout."""
    for work, dropout, targets in (
        ("GAN iteration, dropout 0", 0.0, (0.25, 0.65)),
        ("GAN iteration, dropout 0.3", 0.3, (0.5, None)),
    ):
        given = {"num_iterations": 5, "dropout": dropout}
        workers = {
            "ours": Worker("ours", "gan_iteration", **given),
            "textbook loop": Worker(
                "textbook_gan", "gan_iteration", num_iterations=3, dropout=dropout
            ),
            "one tf.function": Worker("keras_plain", "gan_iteration", **given),
        }
        found = measure(workers)
        for name, target in zip(("textbook loop", "one tf.function"), targets, strict=True):
            yield _row(work, workers, found, name, target)


def generation() -> Iterator[dict]:
    """Benchmarks the generation of windows, in memory and to Parquet."""
    given = {"num_windows": 4_096}
    workers = {
        "product": Worker("ours", "matrix_product"),
        "predict": Worker("keras_plain", "enhance_and_noise", **given),
        **{
            name: Worker("ours", name, **given)
            for name in ("enhance_and_noise", "generate", "generate_to_parquet")
        },
    }
    found = measure(workers)
    product = [WINDOW_FLOP * each for each in found["product"]]
    window = "generation of a window, enhancer + noise"
    yield compared(window, found["enhance_and_noise"], "matrix-product rate", product, target=1.25)
    yield compared(window, found["enhance_and_noise"], "Keras' predict", found["predict"])
    yield compared(
        "generation of a window, coarse simulator included",
        found["generate"],
        "matrix-product rate",
        product,
    )
    window = "generation of a window to Parquet"
    yield compared(
        window, found["generate_to_parquet"], "generation in memory", found["generate"], target=1.67
    )


def starting() -> Iterator[dict]:
    """Benchmarks the start of commands that need no network."""
    command = ("-m", "enhsim_tf.reproduce")
    arguments = {
        "--help": (*command, "--help"),
        "an argument error": (*command, "--only", "fig99"),
        "import enhsim_tf": ("-c", "import enhsim_tf"),
        "import tensorflow": ("-c", "import tensorflow"),
    }
    found = in_turns({name: _timed(each) for name, each in arguments.items()}, REPETITIONS)
    theirs = found.pop("import tensorflow")
    for name, ours in found.items():
        yield compared(name, ours, "import tensorflow", theirs, "s")


def _timed(arguments: Sequence[str]) -> Callable[[], float]:
    def run() -> float:
        began = time.perf_counter()
        subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
        return time.perf_counter() - began

    return run


def _row(
    work: str,
    workers: Mapping[str, Worker],
    found: Mapping[str, list[float]],
    comparison: str,
    target: float | None,
) -> dict:
    """The row of a comparison, which may have been skipped."""
    if skipped := workers[comparison].skipped:
        return {"work": work, "comparison": comparison, "skipped": skipped}
    return compared(work, found["ours"], comparison, found[comparison], target=target)
