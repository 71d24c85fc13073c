"""Noise models are made again from what is saved of them, and what describes no noise is refused."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.noise.candidates import fit_candidate, model_from, state_of
from enhsim_tf.noise.names import CANDIDATES

WINDOWS = np.random.default_rng(0).standard_normal((30, 40, 2)).astype(np.float32)
CLEAN = np.sin(np.arange(40) / 5).astype(np.float32)[:, None] * np.ones((30, 1, 2), np.float32)


@pytest.mark.parametrize("name", CANDIDATES)
def test_a_saved_noise_model_generates_the_same_noise(name):
    model = fit_candidate(name, WINDOWS, CLEAN, 10 * np.arange(30))
    settings, arrays = state_of(model)
    again = model_from(json.loads(json.dumps(settings)), arrays)
    assert settings["kind"] == name
    for number, signal, draw in ((6, CLEAN[:6], "generate"), (90, np.zeros((90, 2)), "generate_series")):
        first, second = (getattr(each, draw)(number, np.random.default_rng(1), signal) for each in (model, again))
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("settings", "arrays", "words"),
    [
        ({"kind": "pink"}, {}, "unknown noise"),
        ({"kind": "residual windows"}, {"windows": np.full((3, 9, 1), np.nan)}, "not finite"),
        ({"kind": "autoregression", "window": 9, "innovation_sd": [-1.0]}, {"coefficients_0": np.zeros(1)}, "scale"),
    ],
)
def test_what_describes_no_noise_is_refused(settings, arrays, words):
    with pytest.raises(ValueError, match=words):
        model_from(settings, arrays)


def test_other_models_are_refused(refused):
    with refused("SimpleNamespace", "not saved"):
        state_of(SimpleNamespace())
    with refused("'pink'"):
        fit_candidate("pink", WINDOWS, CLEAN)
