"""Which part of a run lies within the range of the training runs: the trust score of run models."""

import numpy as np

from enhsim_tf.detection import metrics
from enhsim_tf.enhancer.held_out_blocks import NUM_FOLDS, block_edges, split_fold
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.enhancer.overlapping import average_windows, cut_run, run_starts
from enhsim_tf.enhancer.scaling import Scaling

_NUM_WINDOWS = 900  # coarse windows for the range and its limit
_LEAST_LIMIT = 1e-3  # lower bound of the limit, for periodic runs whose scores are all close to 0
RATE = 0.01  # share of nominal windows that count as outside the range


class Coverage:
    """Scores how far coarse windows lie outside the training range. Scores above 1 are outside.

    The score is computed from the coarse run only. It cannot detect an error of the simulator itself.

    Args:
        out_of_range: The fitted score on scaled windows.
        limit: Score of the conformal threshold, from held-out blocks of time.
        scaling: Units of the columns.
        window: Length of a window in samples.
    """

    def __init__(self, out_of_range: OutOfRange, limit: float, scaling: Scaling, window: int):
        self.out_of_range, self.limit, self.scaling, self.window = out_of_range, float(limit), scaling, window

    @classmethod
    def fit(cls, inputs: np.ndarray, starts: np.ndarray, scaling: Scaling, rate: float = RATE) -> "Coverage":
        """Fits the range to training windows, with a limit from held-out blocks of time.

        Args:
            inputs: Coarse windows, shape `(windows, samples, columns)`.
            starts: First sample of each window, shape `(windows,)`, in ascending order.
            scaling: Units of the columns.
            rate: Share of nominal windows that count as outside.
        """
        chosen = np.unique(np.linspace(0, len(inputs) - 1, min(len(inputs), _NUM_WINDOWS)).astype(int))
        window, starts = inputs.shape[1], np.asarray(starts)[chosen]
        rows = scaling.scale_inputs(inputs[chosen])
        edges = block_edges(int(starts.min()), int(starts.max()) + window, window)
        folds = [split_fold(starts, window, edges, fold) for fold in range(NUM_FOLDS)]
        scores = np.concatenate([OutOfRange().fit(rows[learnt]).score(rows[held_out]) for learnt, held_out in folds])
        limit = metrics.threshold(scores, rate)
        limit = float(scores.max()) if np.isinf(limit) else limit  # with fewer than 99 windows, the largest of them
        return cls(OutOfRange().fit(rows), max(limit, _LEAST_LIMIT), scaling, window)

    def score(self, coarse: np.ndarray) -> np.ndarray:
        """Scores a run.

        Args:
            coarse: The coarse run, shape `(samples, columns)`, with at least a window of samples.

        Returns:
            The mean score of the windows that contain each sample, float32 of shape `(samples,)`; above 1 is outside.
        """
        starts = run_starts(len(coarse), self.window)
        scores = self.score_windows(cut_run(coarse, starts, self.window))
        return average_windows(lambda rows: np.repeat(scores[rows, None], self.window, axis=1), starts, self.window, len(coarse))

    def score_windows(self, inputs: np.ndarray) -> np.ndarray:
        """Scores windows of shape `(windows, samples, columns)`; returns float64 of shape `(windows,)`."""
        return self.out_of_range.score(self.scaling.scale_inputs(inputs)) / self.limit
