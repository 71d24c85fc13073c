"""How the scores of one method on one series are judged: areas, false alarms, events, onsets.

An alarm is a run of samples above a threshold; alarms at most a window apart are one.
"""

import numpy as np

from enhsim_tf.telemetry.windows import runs_of
from studies.public_benchmarks.telemanom import Ranges

SHARES = (0.01, 0.05)
"""Shares of nominal judged samples at which the events that methods find are compared."""


class Judge:
    """The judged part of a series.

    A score sees as far as its window. So samples within a window of a labelled one do not count as
    nominal.

    Args:
        events: Labelled samples, as half-open ranges in the order of time.
        num_samples: Number of judged samples.
        window: Length of a window in samples.
    """

    def __init__(self, events: Ranges, num_samples: int, window: int):
        self.events = events
        self.window = window
        self.labels, near = np.zeros((2, num_samples), bool)
        for begin, end in events:
            self.labels[begin:end] = True
            near[max(0, begin - window) : end + window] = True
        self.is_nominal = ~near

    def judge(
        self, scores: np.ndarray, past_scores: np.ndarray, flags: np.ndarray
    ) -> dict[str, float]:
        """Judges the scores of samples.

        Args:
            scores: The score of each sample, from the whole series.
            past_scores: Its score from the past alone.
            flags: Which samples are above the method's own threshold.

        Returns:
            `auc_pr`, the area under the precision-recall curve of the samples; `events`, their
            number; at the own threshold the share of nominal samples that is flagged
            (`false_alarms`), the number of events with a flagged sample (`found`), and of those
            that the same alarms touch at random times (`found_by_chance`); `found_at_` each of
            `SHARES`, with the lowest threshold that at most this share of the nominal samples
            exceeds; and with the first of these, as medians in samples, how far the begin of an
            event is from that of its first alarm (`onset_error`), and how long after it a score
            from the past first raises an alarm (`delay`). What is undefined is NaN.
        """
        from sklearn.metrics import average_precision_score

        row = {
            "auc_pr": float(average_precision_score(self.labels, scores)),
            "events": len(self.events),
            "false_alarms": _mean(flags[self.is_nominal]),
            "found": self.num_found(flags),
            "found_by_chance": found_by_chance(flags, self.events),
        }
        for share in SHARES:
            row[f"found_at_{share:g}"] = self.num_found(scores > self.limit(scores, share))
        row["onset_error"] = self.onset_error(scores > self.limit(scores, SHARES[0]))
        row["delay"] = self.delay(past_scores > self.limit(past_scores, SHARES[0]))
        return row

    def limit(self, scores: np.ndarray, share: float) -> float:
        """The lowest threshold that at most a share of the nominal samples exceeds; infinite
        without any.
        """
        nominal = np.sort(scores[self.is_nominal])
        return float(nominal[-1 - int(share * len(nominal) + 1e-9)]) if len(nominal) else np.inf

    def num_found(self, flags: np.ndarray) -> int:
        """The number of events with a flagged sample."""
        return sum(bool(flags[begin:end].any()) for begin, end in self.events)

    def onset_error(self, flags: np.ndarray) -> float:
        """Median distance from the begin of an event to that of the first alarm that touches it."""
        calm = runs_of(~np.asarray(flags, bool))
        joined = np.ones(len(flags), bool)
        for begin, end in calm:
            joined[begin:end] &= begin > 0 and end < len(flags) and end - begin <= self.window
        alarms = runs_of(joined)
        errors = []
        for begin, end in self.events:
            touching = [first for first, last in alarms if first < end and last > begin]
            errors += [abs(first - begin) for first in touching[:1]]
        return float(np.median(errors)) if errors else np.nan

    def delay(self, flags: np.ndarray) -> float:
        """Median time from the begin of an event to the first flagged sample in it."""
        inside = [flags[begin:end] for begin, end in self.events]
        delays = [int(np.argmax(each)) for each in inside if each.any()]
        return float(np.median(delays)) if delays else np.nan


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def found_by_chance(flags: np.ndarray, events: Ranges) -> float:
    """The expected number of events that alarms touch if all of them are moved by the same random
    time, from the end of the series on to its begin.
    """
    counts = np.append(0, np.cumsum(np.tile(flags, 2)))[: 2 * len(flags)]
    num_flags = [
        counts[end - begin :][: len(flags)] - counts[: len(flags)] for begin, end in events
    ]
    return float(sum(np.mean(each > 0) for each in num_flags))
