"""Answers to the exercises of lessons 00 to 13, which their checks compare with a student's answers."""

import dataclasses

import numpy as np
from scipy.stats import binom
from sklearn.metrics import roc_auc_score

from enhsim_tf import SquareWave, SquareWaveSimulator
from enhsim_tf.common.measures import effective_rank, nrmse
from enhsim_tf.paper.claims import degraded_windows
from enhsim_tf.paper.degraded import MODES
from enhsim_tf.paper.noise import build_generator, extract_noise
from enhsim_tf.scoring.metrics import threshold
from studies.common.detectors import PCAResidual

# -- 00 ----------------------------------------------------------------------------------------------------------------------


def mode_hidden_best(pipeline):
    """The degraded mode whose enhanced windows differ least from enhanced nominal ones."""
    windows = {
        mode: pipeline.enhance(degraded_windows(pipeline, mode, pipeline.simulator, 0.8))
        for mode in ("nominal", *MODES)
    }
    return min(MODES, key=lambda mode: np.mean((windows[mode] - windows["nominal"]) ** 2))


def kind_to_deliver(rates):
    """The kind of training data with the smallest largest false-alarm rate, real data aside."""
    return min((kind for kind in rates if kind != "real"), key=lambda kind: rates[kind].max())


# -- 02 ----------------------------------------------------------------------------------------------------------------------


def smallest_nrmse():
    """The NRMSE of the best square wave for a sine, computed over half a period."""
    return np.sqrt(2 * np.var(np.sin(np.pi * (np.arange(100_000) + 0.5) / 100_000)))


def num_distinct(orbit_s, rotation_s):
    """The number of different windows of the two square waves, counted over 60,000 samples."""
    waves = [SquareWave(orbit_s, low=-0.5, high=0.5), SquareWave(rotation_s, low=-0.25, high=0.25)]
    series = SquareWaveSimulator(waves)(np.arange(60_000.0))
    windows = np.lib.stride_tricks.sliding_window_view((series * 4).astype(np.int8), 500)
    return len({window.tobytes() for window in windows})


# -- 04 ----------------------------------------------------------------------------------------------------------------------


def smallest_rank(matrix, centred, center, truth):
    """The smallest rank of the matrix with an NRMSE at most 10 % above that of the whole matrix."""
    left, sizes, right = np.linalg.svd(matrix)
    parts, allowed = centred @ left * sizes, 1.1 * nrmse(centred @ matrix + center, truth)
    return next(r for r in range(1, 501) if nrmse(parts[:, :r] @ right[:r] + center, truth) <= allowed)


def mode_of_largest_gain(pipeline, ridge):
    """The degraded mode, at severity 0.5, in which the error of ridge regression is furthest below that of the network."""
    gains = {}
    for mode in MODES:
        coarse, truth = (
            degraded_windows(pipeline, mode, signal, 0.5) for signal in (pipeline.simulator, pipeline.truth)
        )
        gains[mode] = nrmse(pipeline.enhance(coarse), truth) - nrmse(ridge.predict(coarse), truth)
    return max(gains, key=gains.get)


# -- 05 ----------------------------------------------------------------------------------------------------------------------


def auc_of_best_feature(features, is_generated):
    """The AUC of the single feature that separates best, from 0.5 to 1."""
    aucs = [roc_auc_score(is_generated, column) for column in features.T]
    return max(max(auc, 1 - auc) for auc in aucs)


def right_guesses_needed(number, risk):
    """The smallest number of right answers that guessing reaches with at most this probability."""
    return next(right for right in range(number + 1) if binom.sf(right - 1, number, 0.5) <= risk)


# -- 08 ----------------------------------------------------------------------------------------------------------------------


def best_widths(values, widths, true_sd):
    """The two widths whose extracted noise has the standard deviations closest to the true one; they are equal but for chance."""
    return sorted(widths, key=lambda width: abs(extract_noise(values, width)[0].std() - true_sd))[:2]


def share_of_sd(series, width):
    """The share of the standard deviation of a series that is left after the extraction."""
    return extract_noise(series, width)[0].std() / series.std()


# -- 09 ----------------------------------------------------------------------------------------------------------------------


def rank_of_untrained(settings, latent, hidden):
    """The effective rank of 1,000 windows of an untrained generator."""
    generator = build_generator(dataclasses.replace(settings, latent=latent, generator_units=hidden))
    draws = settings.latent_scale * np.random.default_rng(0).standard_normal((1_000, latent), "float32")
    return effective_rank(generator.predict(draws, verbose=0)[:, :, 0])


# -- 12 ----------------------------------------------------------------------------------------------------------------------


def probability_of_real(accuracy_real, accuracy_generated):
    """The probability that a row is real after the discriminator has called it real, if half of all rows are."""
    called_real = accuracy_real, 1 - accuracy_generated
    return called_real[0] / sum(called_real)


# -- 13 ----------------------------------------------------------------------------------------------------------------------


def recall_with_noise(enhanced, noise, faulty):
    """The recall of a PCA residual whose training and threshold windows are enhanced windows plus noise, for 5 % of false alarms."""
    training, calibration = (windows + added for windows, added in zip(enhanced, noise))
    detector = PCAResidual().fit(training)
    return np.mean(detector.score(faulty) > threshold(detector.score(calibration), 0.05))
