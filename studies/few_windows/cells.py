"""One cell of the study: an environment, a seed and a number of real windows, with all training data."""

import dataclasses
import functools
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, inject
from enhsim_tf.detection.interface import Detector
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.paper.telemetry import true_signal
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows, time_blocks
from studies.common.controls import CONTROLS
from studies.common.example import coarse_simulator, draw_noise
from studies.common.metrics import recall_at_real_rate
from studies.common.settings import Settings
from studies.few_windows.record import (
    ADVERSARIAL,
    BOTH,
    CLASSIFIER,
    CLASSIFIER_ON_REAL,
    CORAL,
    NOISE_MODELS,
    NUM_BLOCKS,
    ONE_LINE,
    REAL,
    SIMULATOR,
    THRESHOLD_ON_REAL,
    WHOLE_WINDOWS,
    CoralAlignment,
    Record,
)

if TYPE_CHECKING:
    import pandas as pd

QUICK = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")  # detectors whose training takes about a second
SEVERITY = 4.0  # of the anomalies, in standard deviations of the noise
_TRAINING_SEVERITIES = (2.0, 8.0)  # range of the anomalies that the classifiers learn
_ADAPTATION = (
    0.1  # weight of the domain's gradient: the best of 0.03, 0.1, 0.3 and 1 on a seed that is not reported lost 0.01 to 0.05 of recall
)
_CORAL_SOURCE = 10  # times as many simulated windows for the covariance of CORAL as for training: they cost nothing
_FRESH, _THRESHOLD, _CORAL, _ANOMALIES = 81, 82, 83, 84  # numbers of random draws


class World:
    """The telemetry of one environment and seed: a long record to learn from, and later windows on which everything is judged.

    Args:
        settings: All settings; `noise` is the environment.
    """

    def __init__(self, settings: Settings):
        self.settings, self.window = settings, settings.paper.window
        counts, chosen = settings.few_windows, settings.paper
        self.length = max(counts.num_real) * self.window
        number = self.length + (2 * counts.num_judged + 1) * self.window
        clean = true_signal(chosen)(chosen.interval * np.arange(number))
        rng = np.random.default_rng([settings.seed, zlib.crc32(b"learning curve")])  # the draw of the published table
        noise = draw_noise(settings.noise, clean, chosen.noise_sd, rng)
        self.noise_sd = float(np.std(noise))
        self.values = (clean + noise).astype(np.float32)
        self.coarse = coarse_simulator(chosen)

    def record(self, num_real: int) -> Record:
        """The last `num_real` windows before a gap of one window, after which the judged windows begin."""
        interval_s = self.settings.paper.interval
        first = self.length - num_real * self.window
        telemetry = Telemetry(self.values[first : self.length], interval_s, name="record", offset_s=first * interval_s)
        return Record(telemetry, self.coarse, self.window, self.settings.few_windows.num_windows, self.settings.seed)

    @functools.cached_property
    def judged(self) -> dict[str, np.ndarray]:
        """Disjoint real windows: `nominal`, `reference` for the matched rate, and `anomalous` with one injected anomaly each."""
        counts = self.settings.few_windows
        starts = self.length + self.window * (1 + np.arange(2 * counts.num_judged))
        windows = cut_windows(self.values, starts, self.window)
        nominal, reference = windows[: counts.num_judged], windows[counts.num_judged :]
        parts = []
        for number, kind in enumerate(INJECTIONS):
            chosen = nominal[np.linspace(0, len(nominal) - 1, counts.num_anomalous).astype(int)]
            for offset, duration in enumerate(DURATIONS):
                rng = np.random.default_rng([self.settings.seed, _ANOMALIES, number, offset])
                pieces = chosen[offset :: len(DURATIONS)]
                parts.append(inject(pieces, kind, SEVERITY, min(duration, self.window), self.noise_sd, rng)[0])
        return {"nominal": nominal, "reference": reference, "anomalous": np.concatenate(parts)}


class Cell:
    """All training data at one number of real windows.

    Args:
        world: The telemetry.
        num_real: Number of real windows.
    """

    def __init__(self, world: World, num_real: int):
        self.world, self.num_real, self.record = world, num_real, world.record(num_real)
        self.rate = world.settings.paper.false_alarm_rate
        self.number, self.seed = world.settings.few_windows.num_windows, world.settings.seed

    def rows(self, stages: Stages) -> "pd.DataFrame":
        """The rows of all training data that are computed for this seed and number of windows.

        The classifiers are a stage of their own: they take most of the time, so the settings give them fewer seeds and numbers of windows.

        Args:
            stages: Runs stages and caches their results.
        """
        import pandas as pd

        chosen, frames = self.world.settings, []
        counts, classifiers = chosen.few_windows, chosen.classifiers
        groups: dict[str, Callable[[], list[dict]]] = {"windows": self._without_networks}
        if chosen.seed - counts.first_seed < classifiers.num_seeds and self.num_real in classifiers.num_real:
            groups["classifiers"] = self._classifiers
        # which seeds and numbers are computed does not affect a cell
        same = dataclasses.replace(counts, num_seeds=0, first_seed=0), classifiers.num_steps
        for name, compute in groups.items():
            depends = (name, self.num_real, chosen.paper.of("telemetry"), self.world.window, chosen.noise, same, self.rate)

            def make(folder: Path, compute: Callable[[], list[dict]] = compute) -> None:
                pd.DataFrame(compute()).to_parquet(folder / "rows.parquet")

            folder = stages.run(f"few windows {self.num_real} {name}", make, depends)
            frames.append(pd.read_parquet(folder / "rows.parquet"))
        return pd.concat(frames, ignore_index=True).assign(num_real=self.num_real, seed=self.seed, environment=chosen.noise)

    def _simulated(self) -> list[dict]:
        found = []
        for model in NOISE_MODELS:
            training, held_out = (self.record.generate(model, self.number, purpose) for purpose in (_FRESH, _THRESHOLD))
            for name, detector in self._fitted(training):
                found.append(self._judge(SIMULATOR + model, name, detector, detector.score(held_out)))
        return found

    def _fitted(self, windows: np.ndarray) -> Iterator[tuple[str, Detector]]:
        for name in QUICK:
            yield name, DETECTORS[name](self.seed).fit(windows)

    def _without_networks(self) -> list[dict]:
        real, starts, window = self.record.windows, self.record.starts, self.world.window
        generated = self.record.generate(WHOLE_WINDOWS, self.number, _FRESH)
        found = self._simulated()
        for arm, extra in ((REAL, generated[:0]), (BOTH, generated)):
            scores: dict[str, list[np.ndarray]] = {name: [] for name in QUICK}
            for training, held_out in time_blocks(starts, NUM_BLOCKS, window):
                for name, detector in self._fitted(np.concatenate([real[training], extra])):
                    scores[name].append(detector.score(real[held_out]))
            for name, detector in self._fitted(np.concatenate([real, extra])):
                found.append(self._judge(arm, name, detector, np.concatenate(scores[name])))
        for name, detector in self._fitted(generated):
            found.append(self._judge(THRESHOLD_ON_REAL, name, detector, detector.score(real)))
        one_line = CONTROLS[ONE_LINE](self.seed).fit(real)
        found.append(self._judge(ONE_LINE, ONE_LINE, one_line, one_line.score(real)))
        return found + self._coral(real)

    def _coral(self, real: np.ndarray) -> list[dict]:
        # The map whitens the windows that it is fitted to better than others, so training and threshold use other windows than these.
        numbers = (_CORAL_SOURCE * self.number, self.number, self.number)
        source, plain, further = (self.record.generate("gaussian", number, _CORAL + 100 * place) for place, number in enumerate(numbers))
        alignment = CoralAlignment.fit(source, real)
        held_out = alignment.apply(further)
        return [self._judge(CORAL, name, each, each.score(held_out)) for name, each in self._fitted(alignment.apply(plain))]

    def _classifiers(self) -> list[dict]:
        from studies.few_windows.domain_adversarial import AnomalyClassifier

        real, steps, found = self.record.windows, self.world.settings.classifiers.num_steps, []
        generated = self.record.generate(WHOLE_WINDOWS, self.number, _FRESH)

        def trained(nominal: np.ndarray, adaptation: float = 0.0) -> Detector:
            return AnomalyClassifier(self.world.window, adaptation, self.seed).fit(nominal, self._with_anomalies(nominal), real, steps)

        for arm, adaptation in ((CLASSIFIER, 0.0), (ADVERSARIAL, _ADAPTATION)):
            network = trained(generated, adaptation)
            found.append(self._judge(arm, CLASSIFIER, network, network.score(real)))
        halves = time_blocks(self.record.starts, 2, self.world.window)
        scores = [trained(real[training]).score(real[held_out]) for training, held_out in halves]
        return [*found, self._judge(CLASSIFIER_ON_REAL, CLASSIFIER, trained(real), np.concatenate(scores))]

    def _with_anomalies(self, nominal: np.ndarray) -> np.ndarray:
        """The windows, each with one injected anomaly; kinds, durations and severities take turns."""
        rng, noise_sd = np.random.default_rng([self.seed, _ANOMALIES]), float(np.std(self.record.residuals[0]))
        parts = []
        for number, kind in enumerate(INJECTIONS):
            pieces = nominal[number :: len(INJECTIONS)]
            for offset, duration in enumerate(DURATIONS):
                severity = float(np.exp(rng.uniform(*np.log(_TRAINING_SEVERITIES))))
                changed = pieces[offset :: len(DURATIONS)]
                parts.append(inject(changed, kind, severity, min(duration, changed.shape[1]), noise_sd, rng)[0])
        return np.concatenate(parts)

    def _judge(self, arm: str, name: str, detector: Detector, threshold_scores: np.ndarray) -> dict:
        threshold, set_for = metrics.finite_threshold(threshold_scores, self.rate)
        scores: Mapping[str, np.ndarray] = {kind: detector.score(windows) for kind, windows in self.world.judged.items()}
        return {
            "arm": arm,
            "detector": name,
            "alarms": int(np.sum(scores["nominal"] > threshold)),
            "windows": len(scores["nominal"]),
            "recall": metrics.recall(scores["anomalous"], threshold),
            "recall_at_real_rate": recall_at_real_rate(scores["reference"], scores["anomalous"], self.rate),
            "set_for": set_for,
        }
