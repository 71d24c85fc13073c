"""The test of degraded modes (claim C9): errors of enhancers and simple methods on faults, inside
and outside the severities of training.

The true degraded signal of the example is known, so every method is compared with it.
"""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.enhancer.candidates import Training
from enhsim_tf.enhancer.names import RIDGE, RIDGE_AND_FEATURES
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.paper.degraded import MODES, degrade
from studies.common.tables import stage_tables
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    import pandas as pd

SEVERITIES = (0.1, 0.25, 0.5, 0.75, 1.0)
LARGEST_TRAINED = 0.5  # largest severity in the training of the methods that learn from faults
METHODS = {
    "coarse": "the coarse signal, unchanged",
    "paper": "the paper's enhancer, trained on nominal windows",
    "ridge": "ridge regression on the same windows",
    "ridge, faults": "ridge regression on windows of all modes with their true response",
    "random features, faults": "the tool's ridge and random features on the same windows",
}
"""Methods that estimate the true windows from coarse windows."""
TRIED = (("nominal", 0.0), *((mode, severity) for mode in MODES for severity in SEVERITIES))
"""The modes and severities of the test."""
Estimate = Callable[[np.ndarray], np.ndarray]


class DegradedModes(Replicate):
    """A replicate with the test of all methods, modes and severities."""

    @functools.cached_property
    def degraded(self) -> "pd.DataFrame":
        """The error of each method, mode and severity, in standard deviations of the nominal
        signal.
        """
        _ = self.example.enhancer_folder
        depends = (self.settings.paper.of("windows"), self.settings.modes)
        after = ("telemetry", "enhancer")
        tables = stage_tables(
            self.stages, "degraded modes", self._tables, depends, after, version=2
        )
        return tables["degraded"]

    def _tables(self) -> dict[str, list[dict[str, object]]]:
        methods = self._methods()
        num_windows = self.settings.modes.num_windows
        unit = float(np.std(self._pairs(None, num_windows, "unit")[1]))
        cells = []
        told = self.stages.progress.loop("mode and severity", len(TRIED))
        for done, (mode, severity) in enumerate(TRIED, 1):
            scenario = None if mode == "nominal" else Degraded(mode, severity)
            coarse, truth = self._pairs(scenario, num_windows, f"test {mode} {severity}")
            for method, estimate in methods.items():
                error = (
                    float(np.sqrt(np.mean((estimate(coarse) - truth) ** 2, dtype=np.float64)))
                    / unit
                )
                cell = {"method": method, "mode": mode, "severity": severity, "nrmse": error}
                cells.append(cell | {"seed": self.settings.seed})
            told(done)
        return {"degraded": cells}

    def _pairs(
        self, scenario: Degraded | None, num_windows: int, purpose: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coarse windows in a mode, and the true noiseless signal at the same times and with the
        same draws.
        """
        chosen = self.settings.paper
        chance = int(self.example.draw(purpose).integers(2**31))
        begins = np.random.default_rng(chance).integers(0, 10**6, num_windows)
        times = chosen.interval * (begins[:, None] + np.arange(chosen.window, dtype=np.float64))
        simulator = self.example.coarse
        coarse = simulator.simulate(times, scenario, np.random.default_rng(chance + 1))
        if scenario is None:
            return coarse, self.example.truth(times).astype(np.float32)
        truth = degrade(
            self.example.truth,
            times,
            scenario.mode,
            scenario.severity,
            simulator.levels,
            min(chosen.orbit_period, chosen.rotation_period),
            np.random.default_rng(chance + 1),
            scenario.first_sample(chosen.window),
        )
        return coarse, truth.astype(np.float32)

    def _randomised_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Coarse and noisy true windows of random configurations: one seventh nominal, the others
        degraded.
        """
        chosen = self.settings
        draws = self.example.draw("configurations")
        per_configuration = chosen.modes.windows_per_configuration
        parts = []
        for number in range(chosen.modes.num_learnt // per_configuration):
            mode = (None, *MODES)[number % (1 + len(MODES))]
            severity = draws.uniform(0, LARGEST_TRAINED)
            onset = draws.uniform(0, 0.75)
            scenario = None if mode is None else Degraded(mode, severity, onset)
            parts.append(self._pairs(scenario, per_configuration, f"configuration {number}"))
        coarse, truth = (np.concatenate(each) for each in zip(*parts, strict=True))
        noise = draws.normal(0, chosen.paper.noise_sd, truth.shape).astype(np.float32)
        return coarse, truth + noise

    def _methods(self) -> dict[str, Estimate]:
        nominal = self.example.windows("train", self.settings.paper.num_windows, "training windows")
        coarse, target = self._randomised_pairs()
        # windows of one configuration are neighbours, and stay in one block
        starts = coarse.shape[1] * np.arange(len(coarse))

        def learnt_on_faults(name: str) -> Estimate:
            enhancer = Training(coarse[:, :, None], target[:, :, None], starts).fit(
                name, self.settings.seed
            )
            return lambda windows: enhancer.predict(windows[:, :, None])[:, :, 0]

        return {
            "coarse": lambda windows: windows,
            "paper": self.example.enhance,
            "ridge": fit_ridge(nominal["coarse"], nominal["target"], nominal["start"]).predict,
            "ridge, faults": learnt_on_faults(RIDGE),
            "random features, faults": learnt_on_faults(RIDGE_AND_FEATURES),
        }
