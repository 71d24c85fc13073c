"""Each arm of a replicate has the signal and the noise that its name says, for the same windows."""

import types

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.robustness.replicate import ARMS, Replicate


class Windows:
    """Data of constant windows, numbered by the purpose that they were drawn for."""

    def __init__(self):
        self.purposes = []

    def windows(self, part, number, purpose=""):
        self.purposes.append((part, purpose))
        coarse = np.full((number, 10), float(len(self.purposes)))
        return {"coarse": coarse, "truth": coarse + 0.25, "target": coarse + 0.5}

    def enhance(self, coarse):
        return coarse + 1_000.0

    def generate_noise(self, number, rng):
        return np.full((number, 10), rng.random())

    def draw(self, purpose):
        return np.random.default_rng(len(purpose))


@pytest.fixture
def replicate(tmp_path):
    made = Replicate(make_settings("smoke"), Stages(tmp_path))
    made.example = Windows()
    ridge = types.SimpleNamespace(predict=lambda coarse: coarse + 2_000.0)
    made.__dict__["_without_network"] = (ridge, types.SimpleNamespace(generate=lambda number, rng: np.full((number, 10), 20.0)))
    return made


def test_each_arm_is_the_clean_signal_of_its_pipeline_and_its_noise(replicate):
    arms = replicate.arms("arms, training")
    assert list(arms) == list(ARMS)
    coarse = arms["coarse"]
    assert (arms["truth"] - coarse == 0.25).all()
    assert (arms["enhanced"] - coarse == 1_000).all()
    assert arms["enhanced + GAN"] - arms["enhanced"] == pytest.approx(np.random.default_rng(len("arms, training, noise")).random())
    assert (arms["ridge + residual windows"] - coarse == 2_020).all()
    assert {len(windows) for windows in arms.values()} == {make_settings("smoke").robustness.num_windows}


def test_training_and_threshold_windows_are_drawn_separately(replicate):
    noises = [arms["enhanced + GAN"] - arms["enhanced"] for arms in map(replicate.arms, ("arms, training", "arms, threshold"))]
    purposes = replicate.example.purposes
    assert len(set(purposes)) == len(purposes) == 4 and [part for part, _ in purposes] == ["train", "train", "train", "calibration"]
    assert noises[0][0, 0] != noises[1][0, 0]
