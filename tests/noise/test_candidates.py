"""Noise models are fitted by name."""

import numpy as np

from enhsim_tf.noise.candidates import fit_candidate

WINDOWS = np.random.default_rng(0).standard_normal((30, 40, 2)).astype(np.float32)


def test_an_unknown_name_is_refused(refused):
    with refused("'pink'"):
        fit_candidate("pink", WINDOWS, WINDOWS)
