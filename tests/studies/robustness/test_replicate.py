"""Each arm of a replicate has the signal and the noise that its name says, for the same windows."""

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.robustness.replicate import ARMS, Replicate


class Constant:
    """A constant noise that records a draw of each generator it was called with."""

    def __init__(self, value):
        self.value, self.draws = value, []

    def generate(self, number, rng):
        self.draws.append(rng.random())
        return np.full((number, 10), self.value)


class Pipeline:
    """An enhancer that adds a number."""

    def __init__(self, value):
        self.value, self.simulator = value, self

    def enhance(self, coarse):
        return coarse + self.value


class Windows:
    """Data whose windows are numbered by the purpose that they were drawn for."""

    def __init__(self):
        self.purposes = []

    def windows(self, part, number, purpose=""):
        self.purposes.append((part, purpose))
        coarse = np.full((number, 10), float(len(self.purposes)))
        return {"coarse": coarse, "truth": coarse + 0.25, "target": coarse + 0.5}

    def enhance(self, coarse):
        return coarse + 1_000.0

    def draw(self, purpose):
        return np.random.default_rng(len(purpose))


@pytest.fixture
def replicate(tmp_path):
    made = Replicate(make_settings("smoke"), Stages(tmp_path))
    made.example = Windows()
    made.__dict__["second"] = Pipeline(2_000.0)
    gans = {"enhanced": "GAN", "residual": "convolutional GAN"}
    made.__dict__["noises"] = {
        pipeline: {noise: Constant(first + number) for number, noise in enumerate((gans[pipeline], "Gaussian", "AR", "bootstrap"))}
        for pipeline, first in (("enhanced", 10.0), ("residual", 20.0))
    }
    return made


def test_each_arm_is_the_clean_signal_of_its_pipeline_and_its_noise(replicate):
    arms = replicate.arms("arms, training")
    assert list(arms) == list(ARMS)
    coarse = arms["coarse"]
    assert (arms["truth"] - coarse == 0.25).all()
    for pipeline, clean, value, first in (("enhanced",) * 2 + (1_000.0, 10.0), ("residual", "residual, no noise", 2_000.0, 20.0)):
        assert (arms[clean] - coarse == value).all()
        for number, noise in enumerate(replicate.noises[pipeline]):
            assert (arms[f"{pipeline} + {noise}"] - arms[clean] == first + number).all()
    assert {len(windows) for windows in arms.values()} == {make_settings("smoke").robustness.num_windows}


def test_training_and_threshold_windows_are_drawn_separately(replicate):
    replicate.arms("arms, training"), replicate.arms("arms, threshold")
    purposes = replicate.example.purposes
    assert len(set(purposes)) == len(purposes) == 4 and [part for part, _ in purposes] == ["train", "train", "train", "calibration"]
    for noises in replicate.noises.values():
        for noise in noises.values():
            assert len(noise.draws) == 2 and noise.draws[0] != noise.draws[1]
