"""The tool called as by its users: `fit` and `score` as processes of their own, and generation in memory.

Times are processor time, so that the load of the machine matters little: `python -m benchmarks.tool fit 1 2700` is one work, start included.
In memory, all work is done by one thread, because threads that wait for each other use processor time, too.
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.examples import Work

PERIOD = 90  # samples
WINDOW = 500


def telemetry(channels: int, samples: int, seed: int = 0) -> np.ndarray:
    """Waves of one period with noise that the channels share in part, float32 of shape `(samples, channels)`."""
    from scipy.signal import lfilter

    rng, at = np.random.default_rng(seed), np.arange(samples)[:, None]
    wave = np.sin(2 * np.pi * at / PERIOD + np.arange(channels)) + 0.3 * np.sin(6 * np.pi * at / PERIOD)
    common = lfilter([1], [1, -0.8], rng.standard_normal(samples))[:, None]
    return (wave + 0.1 * common * rng.uniform(-1, 1, channels) + 0.1 * rng.standard_normal((samples, channels))).astype(np.float32)


def fit(channels: int, samples: int, folder: str | None = None) -> None:
    """Fits with default options, all channels jointly, and saves the simulator to a folder if one is given."""
    from enhsim_tf.simulator.fitting import fit as fit_simulator

    simulator, _ = fit_simulator(_recording(telemetry(channels, samples)))
    if folder:
        simulator.save(folder)


def table(path: str, samples: int) -> None:
    """Writes further telemetry of one channel as CSV, one sample a second."""
    import pandas as pd

    times = pd.date_range("2024-01-01", periods=samples, freq="s", name="time")
    pd.DataFrame({"channel 0": telemetry(1, samples)[:, 0]}, times).to_csv(path)


def command(*arguments: object) -> None:
    """Runs a command of the tool, without what it prints."""
    from enhsim_tf.__main__ import main

    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        sys.exit(main([str(each) for each in arguments]))


def windows(folder: str, number: int, out: str) -> None:
    """Writes labelled windows of a saved simulator to Parquet, half of them of a degraded mode."""
    from enhsim_tf.coarse_simulator.degraded import Degraded
    from enhsim_tf.datasets.labelled_windows import write_windows_labelled
    from enhsim_tf.datasets.places import Share
    from enhsim_tf.simulator.simulator import EnhancedSimulator

    shares = [Share(None, number - number // 2, 0), Share(Degraded("stuck", 0.5), number // 2, 1)]
    write_windows_labelled(Path(out) / "windows.parquet", EnhancedSimulator.load(folder), shares)


def _recording(values: np.ndarray):  # noqa: ANN202  a type of the package, which is imported when a work begins
    from enhsim_tf.coarse_simulator.recording import Recording, Run

    return Recording((Run(values, 0.0),), tuple(f"channel {number}" for number in range(values.shape[1])), 1.0, None, "telemetry")


def generation(noise: str, num_windows: int, window: int = WINDOW) -> Work:
    """Prepares `EnhancedSimulator.generate` with ridge regression, whose speed does not depend on its weights, in memory."""
    from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
    from enhsim_tf.enhancer.model import Enhancer
    from enhsim_tf.noise.candidates import fit_candidate
    from enhsim_tf.simulator.alignment import Waves
    from enhsim_tf.simulator.simulator import EnhancedSimulator

    rng, waves = np.random.default_rng(0), SquareWaveSimulator([SquareWave(PERIOD)])
    weights = (rng.standard_normal((window, window)) / window).astype(np.float32)
    enhancer = Enhancer("ridge", window, 1, 1, np.zeros(1, np.float32), np.zeros(window, np.float32), (weights,))
    clean = waves.simulate(rng.integers(0, PERIOD, 2_500)[:, None] + np.arange(window))[:, :, None]
    model = fit_candidate(noise, _residuals(rng, window)[:, :, None], clean, np.sort(rng.integers(0, 25_000, 2_500)))
    alignment = Waves([waves], ("telemetry",), 1.0, window)
    made = EnhancedSimulator(alignment, enhancer, model, levels=np.tile([0.0, 1.0], (500, 1)))
    return _processor_time(lambda: made.generate(num_windows)), num_windows


def product_gather_sum(num_windows: int, window: int = WINDOW) -> Work:
    """Prepares the limit for generation: one product, one gather and one sum of NumPy of that size."""
    rng = np.random.default_rng(0)
    coarse, weights = rng.standard_normal((num_windows, window), np.float32), rng.standard_normal((window, window), np.float32)
    residuals = _residuals(rng, window)

    def run() -> None:
        windows = coarse @ weights
        windows += residuals[rng.integers(0, len(residuals), num_windows)]

    return _processor_time(run), num_windows


def _residuals(rng: np.random.Generator, window: int) -> np.ndarray:
    return rng.standard_normal((2_500, window), np.float32)


def _processor_time(work: Callable[[], object]) -> Callable[[], float]:
    def run() -> float:
        with threadpool_limits(1):
            began = time.process_time()
            work()
            return time.process_time() - began

    return run


def seconds_of(*arguments: str) -> float:
    """Runs a work of this module as a process, and returns its processor time in seconds, start included."""
    process = os.spawnv(os.P_NOWAIT, sys.executable, [sys.executable, "-m", "benchmarks.tool", *arguments])
    _, status, used = os.wait4(process, 0)
    if status:
        raise RuntimeError(f"Expected a work that ends well. Received: {' '.join(arguments)} with status {status}. Run it by hand.")
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    name, *given = sys.argv[1:]
    {"fit": fit, "command": command, "windows": windows}[name](*(int(each) if each.isdecimal() else each for each in given))
