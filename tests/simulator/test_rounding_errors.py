"""Rounding errors of 32-bit telemetry do not tell noise from noise."""

import numpy as np

from enhsim_tf.common.two_sample import boosted_trees
from enhsim_tf.common.window_features import window_features
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.noise_choice import HeldOutJudge, NoiseWindows


def test_noise_on_levels_is_not_told_from_itself_by_rounding_errors():
    rng = np.random.default_rng(0)
    noise = 0.05 * np.rint(rng.standard_normal((600, 60)) / 0.5)
    signal = np.sin(np.arange(60) / 7 + rng.uniform(0, 6, (600, 1)))
    # the noise of telemetry that is stored in 32 bits, and exact noise
    stored = (signal + noise).astype(np.float32) - signal.astype(np.float32)
    assert 0 < np.max(np.abs(stored - noise)) < 1e-6
    exact, real = noise[:300], stored[300:]
    assert boosted_trees(window_features(exact / 0.1), window_features(real / 0.1)).auc > 0.7
    signal32, places = signal.astype(np.float32), 60 * np.arange(600)
    learnt, judged = (NoiseWindows(stored[some], signal32[some], places[some]) for some in (slice(0, 300), slice(300, None)))
    judgement = HeldOutJudge(learnt, judged, seed=0).judge("exact", WindowBootstrap(exact), rng)
    assert judgement.auc < 0.58
