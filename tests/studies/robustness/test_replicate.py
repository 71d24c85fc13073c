"""Tests that each arm of a replicate has the enhanced signal and the noise that its name says, for the same windows."""

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.reproduce.settings import make_settings
from studies.robustness import replicate as replicates
from studies.robustness.replicate import ARMS, MIXED, PAPER, PREFIXES, RESIDUAL, SCALED, SCALES, SHARES, VARIATIONS, Replicate

NOISES = {PAPER: ("GAN", "Gaussian", "AR", "bootstrap"), RESIDUAL: ("convolutional GAN", "Gaussian", "AR", "bootstrap")}


class Constant:
    """A constant noise that records the seeds it was called with."""

    def __init__(self, value):
        self.value, self.seeds = value, []

    def generate(self, number, seed):
        self.seeds.append(seed)
        return np.full((number, 10), self.value)


class Pipeline:
    """An enhancer that adds a number."""

    def __init__(self, value):
        self.value = value

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

    def draw(self, purpose):
        return np.random.default_rng(len(purpose))


@pytest.fixture
def replicate(tmp_path):
    made = Replicate(make_settings("smoke"), Stages(tmp_path))
    made.experiment = type("Experiment", (), {"data": Windows(), "simulator": Pipeline(1_000.0)})()
    made.__dict__["second_simulator"] = Pipeline(2_000.0)
    made.__dict__["surrogates"] = {
        pipeline: {noise: Constant(first + number) for number, noise in enumerate(NOISES[pipeline])}
        for pipeline, first in ((PAPER, 10.0), (RESIDUAL, 20.0))
    }
    return made


def test_each_arm_is_the_clean_signal_of_its_pipeline_and_its_noise(replicate):
    arms = replicate.arms("arms, training")
    assert list(arms) == list(ARMS)
    coarse = arms["coarse"]
    assert (arms["truth"] - coarse == 0.25).all()
    for pipeline, clean, value, first in ((PAPER, "enhanced", 1_000.0, 10.0), (RESIDUAL, "residual, no noise", 2_000.0, 20.0)):
        assert (arms[clean] - coarse == value).all()
        for number, noise in enumerate(NOISES[pipeline]):
            assert (arms[f"{PREFIXES[pipeline]} + {noise}"] - arms[clean] == first + number).all()
    assert {len(windows) for windows in arms.values()} == {make_settings("smoke").robustness.num_windows}


def test_training_and_threshold_windows_are_drawn_separately(replicate):
    replicate.arms("arms, training"), replicate.arms("arms, threshold")
    purposes = replicate.experiment.data.purposes
    assert len(set(purposes)) == len(purposes) == 4 and [part for part, _ in purposes] == ["train", "train", "train", "calibration"]
    for noises in replicate.surrogates.values():
        for noise in noises.values():
            assert len(noise.seeds) == 2 and noise.seeds[0] != noise.seeds[1]


def test_only_the_noise_is_scaled():
    arms = {"residual, no noise": np.array([1.0, 2.0]), "residual + convolutional GAN": np.array([1.5, 1.0]), "real": np.array([7.0, 8.0])}
    assert replicates._scaled(arms, "residual + convolutional GAN", 2.0).tolist() == [2.0, 0.0]
    for arm in ("residual, no noise", "real"):
        assert replicates._scaled(arms, arm, 2.0).tolist() == arms[arm].tolist()


def test_random_draws_keep_the_names_of_the_published_run():
    drawn = {replicates._DRAW_NAMES.get(arm, arm) for arm, _, share, _ in VARIATIONS if share}
    assert drawn == {"enhanced", "enhanced + GAN", "ours", "ours + GAN", "real"}  # names that seeded the published draws


def test_each_variation_is_made_once():
    assert len(set(VARIATIONS)) == len(VARIATIONS) == len(SCALED) * len(SCALES) + len(MIXED) * (2 * len(SHARES) - 1) - 2 + 1
    assert {scale for arm, scale, share, _ in VARIATIONS if arm in SCALED and not share} >= {0.5, 1.0, 2.0}
    assert set(SCALED) & set(MIXED) == {"enhanced + GAN", "residual + convolutional GAN"}  # whose scale 1 and share 0 are one


@pytest.mark.usefixtures("narrow_enhancer")
def test_surrogates_are_fitted_to_the_training_windows_of_the_networks(tmp_path, monkeypatch):
    learnt, fit = [], NoiseGAN.fit

    def spied(self, windows, *args, **kwargs):
        learnt.append(np.array(windows))
        return fit(self, windows, *args, **kwargs)

    monkeypatch.setattr(NoiseGAN, "fit", spied)
    real = Replicate(make_settings("smoke"), Stages(tmp_path))
    assert real.experiment.noise_folder.is_dir() and real.second_simulator.window == 500
    paper, residual = learnt
    assert np.array_equal(real.extracted[PAPER], paper) and np.array_equal(real.extracted[RESIDUAL], residual)
    assert len(residual) == real.settings.second.num_windows
    for pipeline, noise in real.disjoint_extracted.items():  # in other windows, the same noise
        assert np.std(noise) == pytest.approx(np.std(learnt[(PAPER, RESIDUAL).index(pipeline)]), rel=0.1)
