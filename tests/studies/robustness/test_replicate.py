"""Each arm of a replicate has the signal and the noise that its name says, for the same windows."""

import types

import numpy as np

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.robustness.replicate import ARMS, Replicate

ARM = "ridge + residual windows"


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


def test_each_arm_is_the_clean_signal_of_its_pipeline_and_its_noise_on_windows_that_are_drawn_once(
    tmp_path,
):
    replicate = Replicate(make_settings("smoke"), Stages(tmp_path))
    replicate.example = Windows()
    ridge = types.SimpleNamespace(predict=lambda coarse: coarse + 2_000.0)
    replicate._without_network = (
        ridge,
        types.SimpleNamespace(generate=lambda number, rng: np.full((number, 10), 20.0)),
    )
    for purpose in ("arms, training", "arms, threshold"):
        arms = replicate.arms(purpose)
        assert list(arms) == list(ARMS)
        number = make_settings("smoke").robustness.num_windows
        assert {len(windows) for windows in arms.values()} == {number}
        added = {
            name: np.unique((windows - arms["coarse"]).round(9)).tolist()
            for name, windows in arms.items()
            if name != "real"
        }
        noise = round(np.random.default_rng(len(f"{purpose}, noise")).random(), 9)
        assert added == {
            "coarse": [0],
            "truth": [0.25],
            "enhanced": [1_000],
            "enhanced + GAN": [1_000 + noise],
            ARM: [2_020],
        }
    purposes = replicate.example.purposes
    assert len(set(purposes)) == 4
    assert [part for part, _ in purposes] == ["train", "train", "train", "calibration"]
