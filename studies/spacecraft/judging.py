"""How a detector is judged on the test part of a channel: false alarms, labelled sequences that are found, and areas under curves."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection import metrics
from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.telemetry.windows import mean_over_windows
from studies.common.metrics import vus_pr
from studies.spacecraft.telemanom import LabelledChannel

RATES = (0.01, 0.05, 0.1)
"""Shares of nominal test windows at which the sequences that detectors find are compared."""
STRIDES = 8
"""Scored windows a window's length."""


class Judge:
    """The test part of a channel, on which every detector is judged.

    Args:
        channel: The channel with its labels.
        window: Length of a window in samples.
        period: Period of the channel in samples, the largest buffer of VUS-PR.
        rate: False-alarm rate that thresholds are set for.

    Raises:
        InputError: If every window of the test part holds a labelled sample.
    """

    def __init__(self, channel: LabelledChannel, window: int, period: float, rate: float):
        self.window, self.period, self.rate = window, period, rate
        self.labels = np.array(channel.is_anomalous)
        self.begins = np.arange(0, len(channel.test) - window + 1, max(1, window // STRIDES))
        self.windows = cut_windows(channel.test.values, self.begins, window)
        self.meets = windows_that_meet(self.begins, window, channel.sequences)
        self.is_nominal = ~self.meets.any(axis=0)
        if not self.is_nominal.any():
            raise InputError(
                f"Expected a test part with windows of {window} samples that hold no labelled sample. "
                f"Received: none of {len(self.begins)} in {channel.name}. Use another channel."
            )

    def judge(self, scores: np.ndarray, own: np.ndarray, past: np.ndarray) -> dict[str, Any]:
        """Judges one detector.

        Detectors whose thresholds give different false-alarm rates cannot be compared by what they find. Each `found_at` is
        therefore counted with the lowest threshold that at most this share of the nominal test windows is above.

        Args:
            scores: Its scores of `windows`.
            own: Its scores of held-out windows of its training data, which set its threshold.
            past: Its scores of windows of the train part.

        Returns:
            `false_alarms` and `false_alarms_past`, the shares of nominal test windows above the thresholds that `own` and `past`
            set; `found_at_` each of `RATES`, in labelled sequences; `sequences`, their number; `auc_pr` and `vus_pr`, the areas
            under the precision-recall curve of the samples.
        """
        from sklearn.metrics import average_precision_score

        nominal = np.sort(scores[self.is_nominal])
        limits = {rate: nominal[-1 - int(rate * len(nominal) + 1e-9)] for rate in RATES}
        by_sample = mean_over_windows(scores, self.begins, self.window, len(self.labels))
        return {
            "false_alarms": float(np.mean(nominal > metrics.finite_threshold(own, self.rate)[0])),
            "false_alarms_past": float(
                np.mean(nominal > metrics.finite_threshold(past, self.rate)[0])
            ),
            **{
                f"found_at_{rate:g}": sum(bool((scores[each] > limit).any()) for each in self.meets)
                for rate, limit in limits.items()
            },
            "sequences": len(self.meets),
            "auc_pr": float(average_precision_score(self.labels, by_sample)),
            "vus_pr": vus_pr(self.labels, by_sample, round(self.period)),
        }


def windows_that_meet(
    begins: np.ndarray, window: int, ranges: Sequence[tuple[int, int]]
) -> np.ndarray:
    """Tells which windows share a sample with which half-open range, boolean of shape `(ranges, windows)`."""
    bounds = np.asarray(ranges, np.int64).reshape(-1, 2)
    return (begins < bounds[:, 1:]) & (begins + window > bounds[:, :1])
