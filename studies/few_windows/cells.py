"""One cell of the study: an environment, a seed and a number of real windows, with all training
data.
"""

import dataclasses
import functools
import zlib
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.paper.telemetry import cut_windows, true_signal
from enhsim_tf.scoring import metrics
from enhsim_tf.telemetry.series import Telemetry
from studies.common.detectors import DETECTORS
from studies.common.evaluation import cross_fitted_scores, recall_at_real_rate
from studies.common.example import coarse_simulator, draw_noise
from studies.common.injections import inject_durations
from studies.common.settings import Settings
from studies.common.tables import stage_tables
from studies.few_windows.record import (
    CORAL,
    NOISE_MODELS,
    NUM_BLOCKS,
    REAL,
    SIMULATOR,
    Record,
    coral_alignment,
)

if TYPE_CHECKING:
    import pandas as pd

# detectors whose training takes about a second
QUICK = ("limit check", "PCA residual", "nearest neighbours", "isolation forest")
SEVERITY = 4.0  # of the anomalies, in standard deviations of the noise
# times as many simulated windows for the covariance of CORAL as for training: they cost nothing
_CORAL_SOURCE = 10
# numbers of random draws
_FRESH = 81
_THRESHOLD = 82
_CORAL = 83
_ANOMALIES = 84


class World:
    """The telemetry of one environment and seed: a long record to learn from, and later windows on
    which everything is judged.

    Args:
        settings: All settings; `noise` is the environment.
    """

    def __init__(self, settings: Settings):
        self.settings = settings
        self.window = settings.paper.window
        counts = settings.few_windows
        chosen = settings.paper
        self.length = max(counts.num_real) * self.window
        number = self.length + (2 * counts.num_judged + 1) * self.window
        clean = true_signal(chosen)(chosen.interval * np.arange(number))
        # the draw of the published table
        rng = np.random.default_rng([settings.seed, zlib.crc32(b"learning curve")])
        noise = draw_noise(settings.noise, clean, chosen.noise_sd, rng)
        self.noise_sd = float(np.std(noise))
        self.values = (clean + noise).astype(np.float32)
        self.coarse = coarse_simulator(chosen)

    def record(self, num_real: int) -> Record:
        """The last `num_real` windows before a gap of one window, after which the judged windows
        begin.
        """
        interval_s = self.settings.paper.interval
        first = self.length - num_real * self.window
        telemetry = Telemetry.of(
            self.values[first : self.length], interval_s, name="record", offset_s=first * interval_s
        )
        return Record(
            telemetry,
            self.coarse,
            self.window,
            self.settings.few_windows.num_windows,
            self.settings.seed,
        )

    @functools.cached_property
    def judged(self) -> dict[str, np.ndarray]:
        """Disjoint real windows: `nominal`, `reference` for the matched rate, and `anomalous` with
        one injected anomaly each.
        """
        counts = self.settings.few_windows
        starts = self.length + self.window * (1 + np.arange(2 * counts.num_judged))
        windows = cut_windows(self.values, starts, self.window)
        nominal = windows[: counts.num_judged]
        reference = windows[counts.num_judged :]
        chosen = nominal[np.linspace(0, len(nominal) - 1, counts.num_anomalous).astype(int)]
        parts = [
            inject_durations(
                chosen, kind, SEVERITY, self.noise_sd, [self.settings.seed, _ANOMALIES, number]
            )
            for number, kind in enumerate(INJECTIONS)
        ]
        return {"nominal": nominal, "reference": reference, "anomalous": np.concatenate(parts)}

    def tables(self, stages: Stages) -> "dict[str, pd.DataFrame]":
        """The table `rows`, with every number of real windows."""
        import pandas as pd

        parts = [self.rows(number, stages) for number in self.settings.few_windows.num_real]
        return {"rows": pd.concat(parts, ignore_index=True)}

    def rows(self, num_real: int, stages: Stages) -> "pd.DataFrame":
        """The rows of all training data at a number of real windows, which are a stage of their
        own.
        """
        chosen = self.settings
        # which seeds are computed does not affect a cell
        same = dataclasses.replace(chosen.few_windows, num_seeds=0, first_seed=0)
        depends = (
            num_real,
            chosen.paper.of("telemetry"),
            self.window,
            chosen.noise,
            same,
            chosen.paper.false_alarm_rate,
        )
        about = {"num_real": num_real, "seed": chosen.seed, "environment": chosen.noise}

        def compute() -> dict[str, list[dict]]:
            return {"rows": [row | about for row in self._rows(self.record(num_real))]}

        return stage_tables(stages, f"few windows {num_real}", compute, depends)["rows"]

    def _rows(self, record: Record) -> list[dict]:
        number = self.settings.few_windows.num_windows
        seed = self.settings.seed
        real = record.windows
        rows = []
        for name in QUICK:
            make = functools.partial(DETECTORS[name], seed)
            past = cross_fitted_scores(make, real, record.starts, NUM_BLOCKS)
            rows.append({"arm": REAL, "detector": name} | self._judge(make().fit(real).score, past))
        generated = {
            SIMULATOR + model: [
                record.generate(model, number, draw) for draw in (_FRESH, _THRESHOLD)
            ]
            for model in NOISE_MODELS
        }
        # The map whitens the windows that it is fitted to better than others, so training and
        # threshold use other windows than these.
        numbers = (_CORAL_SOURCE * number, number, number)
        source, *others = (
            record.generate("gaussian", each, _CORAL + 100 * place)
            for place, each in enumerate(numbers)
        )
        align = coral_alignment(source, real)
        generated[CORAL] = [align(windows) for windows in others]
        for arm, (training, held_out) in generated.items():
            for name in QUICK:
                score = DETECTORS[name](seed).fit(training).score
                rows.append({"arm": arm, "detector": name} | self._judge(score, score(held_out)))
        return rows

    def _judge(
        self, score: Callable[[np.ndarray], np.ndarray], threshold_scores: np.ndarray
    ) -> dict:
        rate = self.settings.paper.false_alarm_rate
        threshold, _ = metrics.finite_threshold(threshold_scores, rate)
        nominal, reference, anomalous = (
            score(self.judged[kind]) for kind in ("nominal", "reference", "anomalous")
        )
        return {
            "alarms": int(np.sum(nominal > threshold)),
            "windows": len(nominal),
            "recall": metrics.recall(anomalous, threshold),
            "recall_at_real_rate": recall_at_real_rate(reference, anomalous, rate),
        }
