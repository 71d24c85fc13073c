"""The test of degraded modes (claim C9): errors of enhancers and simple methods on faults, inside and outside the severities of training.

The true degraded signal of the example is known, so every method is compared with it.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded, degrade
from enhsim_tf.common import measures
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.enhancer.ridge import fit_ridge
from studies.common.nearest_windows import fit_nearest_windows
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.common.backend import keras

SEVERITIES = (0.1, 0.25, 0.5, 0.75, 1.0)
LARGEST_TRAINED = 0.5  # largest severity in the training of the randomised methods
WIDTHS = (11, 25, 49, 75, 121, 181, 241)  # of the moving average of the coarse signal; the best on training windows is selected
METHODS = {
    "identity": "the coarse signal, unchanged",
    "moving average": "the coarse signal, smoothed",
    "ridge": "ridge regression, trained on nominal windows",
    "ridge, randomised": "ridge regression, trained on windows of all modes with their true response",
    "nearest windows": "the mean of the nearest nominal training windows",
    "nearest windows, randomised": "the mean of the nearest windows of all modes with their true response",
    "paper": "the paper's enhancer: 1,500 nominal windows, 40 epochs",
    "more windows": "the same network: 15,000 nominal windows, 2 epochs, decaying learning rate",
    "randomised": "trained like *more windows*, on nominal and degraded configurations with their true response",
}
"""Methods that estimate the true windows from coarse windows."""
SCORED = {"paper": "nominal", "more windows": "nominal", "randomised": "randomised"}
"""The methods that are networks: they have an out-of-range score, of the windows on which they are trained."""
TRIED = (("nominal", 0.0), *((mode, severity) for mode in MODES for severity in SEVERITIES))
"""The modes and severities of the test."""
Estimate = Callable[[np.ndarray], np.ndarray]


class DegradedModes:
    """All methods, modes and severities of one replicate.

    Args:
        replicate: The replicate, which has trained both nominal enhancers.
    """

    def __init__(self, replicate: Replicate):
        self.replicate, self.settings, self.stages = replicate, replicate.settings, replicate.stages
        self.example = replicate.example

    @functools.cached_property
    def table(self) -> "pd.DataFrame":
        """The error of each method, mode and severity, in standard deviations of the nominal signal, and the out-of-range score."""
        import pandas as pd

        _ = self.example.enhancer_folder, self.replicate.second.simulator
        depends = (self.settings.paper.of("windows"), self.settings.modes)
        folder = self.stages.run("degraded modes", self._make, depends, ("telemetry", "enhancer", "second network"))
        return pd.read_parquet(folder / "degraded.parquet")

    def _make(self, folder: Path) -> None:
        import pandas as pd

        nominal, randomised = self._nominal_windows(), self._randomised_pairs()
        methods = self._methods(nominal, randomised)
        scores = {name: OutOfRange().fit(windows) for name, windows in (("nominal", nominal[0]), ("randomised", randomised[0]))}
        unit = float(np.std(self._pairs(None, self.settings.modes.num_windows, "unit")[1]))
        cells, told = [], self.stages.progress.loop("mode and severity", len(TRIED))
        for done, (mode, severity) in enumerate(TRIED, 1):
            coarse, truth = self._test_pairs(mode, severity)
            found = {name: float(np.mean(score.score(coarse))) for name, score in scores.items()}
            for method, estimate in methods.items():
                error = float(np.sqrt(np.mean((estimate(coarse) - truth) ** 2, dtype=np.float64))) / unit
                score = found[SCORED[method]] if method in SCORED else np.nan
                cells.append({"method": method, "mode": mode, "severity": severity, "nrmse": error, "score": score})
            told(done)
        pd.DataFrame(cells).assign(seed=self.settings.seed).to_parquet(folder / "degraded.parquet")

    def _test_pairs(self, mode: str, severity: float) -> tuple[np.ndarray, np.ndarray]:
        scenario = None if mode == "nominal" else Degraded(mode, severity)
        return self._pairs(scenario, self.settings.modes.num_windows, f"test {mode} {severity}")

    def _pairs(self, scenario: Degraded | None, num_windows: int, purpose: str) -> tuple[np.ndarray, np.ndarray]:
        """Coarse windows in a mode, and the true noiseless signal at the same times and with the same draws."""
        chosen, chance = self.settings.paper, int(self.example.draw(purpose).integers(2**31))
        begins = np.random.default_rng(chance).integers(0, 10**6, num_windows)
        times = chosen.interval * (begins[:, None] + np.arange(chosen.window, dtype=np.float64))
        size, shortest = chosen.orbit_amplitude + chosen.rotation_amplitude, min(chosen.orbit_period, chosen.rotation_period)
        coarse = self.example.coarse.simulate(times, scenario, np.random.default_rng(chance + 1))
        truth = degrade(self.example.truth, times, scenario, (-size, size), shortest, np.random.default_rng(chance + 1))
        return coarse, truth.astype(np.float32)

    def _nominal_windows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coarse windows and telemetry of the training part, and the first sample of each."""
        windows = self.example.windows("train", self.settings.second.num_windows, "nominal configurations")
        return windows["coarse"], windows["target"], windows["start"]

    def _randomised_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Coarse and noisy true windows of random configurations: one seventh nominal, the others degraded."""
        chosen, draws = self.settings, self.example.draw("configurations")
        per_configuration = chosen.modes.windows_per_configuration
        parts = []
        for number in range(chosen.second.num_windows // per_configuration):
            mode = (None, *MODES)[number % (1 + len(MODES))]
            severity, onset = draws.uniform(0, LARGEST_TRAINED), draws.uniform(0, 0.75)
            scenario = None if mode is None else Degraded(mode, severity, onset)
            parts.append(self._pairs(scenario, per_configuration, f"configuration {number}"))
        coarse, truth = (np.concatenate(each) for each in zip(*parts, strict=True))
        noise = draws.normal(0, chosen.paper.noise_sd, truth.shape).astype(np.float32)
        return coarse, truth + noise

    def _methods(
        self, nominal: tuple[np.ndarray, np.ndarray, np.ndarray], randomised: tuple[np.ndarray, np.ndarray]
    ) -> dict[str, Estimate]:
        from scipy.ndimage import uniform_filter1d

        from enhsim_tf.common.training import predict_windows

        def smooth(width: int) -> Estimate:
            return functools.partial(uniform_filter1d, size=width, axis=1, mode="nearest")

        width = min(WIDTHS, key=lambda each: measures.nrmse(smooth(each)(nominal[0][:1_000]), nominal[1][:1_000]))
        return {
            "identity": lambda coarse: coarse,
            "moving average": smooth(width),
            "ridge": fit_ridge(*nominal).predict,
            "ridge, randomised": fit_ridge(*randomised).predict,
            "nearest windows": fit_nearest_windows(*nominal),
            "nearest windows, randomised": fit_nearest_windows(*randomised),
            "paper": self.example.enhance,
            "more windows": self.replicate.second.simulator.enhance,
            "randomised": functools.partial(predict_windows, self._train(*randomised), batch_size=1_024),
        }

    def _train(self, coarse: np.ndarray, target: np.ndarray) -> "keras.Model":
        """Trains the enhancer of the residual pipeline on other windows."""
        from enhsim_tf.common.backend import keras
        from enhsim_tf.common.training import dense_stack, fit_windows

        seed, epochs, batch_size = self.settings.seed, self.settings.second.epochs, self.settings.paper.batch_size
        window, units = self.settings.paper.window, self.settings.paper.hidden_units
        network = dense_stack(window, (window, units, units, window), seed, "enhancer")
        rate = keras.optimizers.schedules.CosineDecay(0.001, epochs * -(-len(coarse) // batch_size))
        told = self.stages.progress.loop("enhancer, epoch", epochs)
        watch = keras.callbacks.LambdaCallback(on_epoch_end=lambda epoch, logs: told(epoch + 1))
        fit_windows(network, coarse, target, epochs, batch_size, seed, rate, callbacks=[watch])
        return network
