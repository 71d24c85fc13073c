"""The study that runs the author's code. A stand-in of our own takes the place of his file, which
is no part of the project.
"""

import json

import numpy as np
import pandas as pd
import pytest

from studies.author_code.__main__ import main
from studies.author_code.figure import FIGURES
from studies.author_code.run import EXTRACTED, KEYS, WHITE, Run, runs, settings_of
from studies.author_code.summary import MEASURED, READING_OF, beside, pairs
from studies.readings.run import READINGS

STAND_IN = """
import json, pathlib
import numpy as np
from matplotlib import pyplot as plt

class Network:
    def __init__(self):
        self.weight = np.zeros(3)
    def get_weights(self):
        return [self.weight]
    def predict(self, latent):
        return np.repeat(latent[:, :1, None], 500, axis=1)

class OneDGAN2:
    def define_discriminator(self):
        self.d_model = Network()
    def define_generator(self):
        self.g_model = Network()
    def define_gan(self):
        pass
    def train(self, iterations, every, side):
        rows, tags = self.generate_real_samples()
        again, _ = self.generate_real_samples()
        seen = {{"shape": rows.shape, "again": bool((rows == again).all()), "tags": tags.sum(),
                "steps": np.unique(np.diff(rows, axis=1)).tolist(), "span": self.span}}
        pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(seen))
        axes = plt.figure().subplots(side, side)
        axes[0, 0].plot(rows[:, :, 0].T)
        plt.pause(0.001)
        self.d_model.weight = self.d_model.weight + {learnt}
        return {{"real_acc": [0.5], "fake_acc": [0.5], "real_loss": [0.7], "fake_loss": [0.7]}}
"""


@pytest.fixture
def trained(tmp_path):
    pytest.importorskip("tf_keras", reason="legacy Keras is an extra: enhsim_tf[author]")
    from studies.author_code.train import train

    def run(learnt=1):
        code = tmp_path / "OneDGAN2.py"
        code.write_text(STAND_IN.format(learnt=learnt))
        found = train(code, np.arange(5_000.0), 3, 4.0, 25, 25, 5)
        return found, json.loads(code.with_suffix(".json").read_text())

    return run


def test_his_class_gets_windows_of_the_series_drawn_anew_and_nothing_is_drawn(trained):
    found, seen = trained()
    about = {"shape": [200, 500, 1], "again": False, "tags": 200.0, "steps": [1.0], "span": 4.0}
    assert seen == about
    assert found["followed"].shape == (1, 200, 500)
    assert found["real_acc"] == [0.5] and found["generated"].shape == (10, 500, 1)


def test_a_discriminator_that_does_not_learn_is_an_error(trained):
    with pytest.raises(RuntimeError, match="unchanged weights"):
        trained(learnt=0)


def test_both_kinds_of_noise_come_seed_by_seed_before_his_demo():
    planned = runs(10, 5, 3)
    assert len(planned) == 28
    assert planned[:3] == [
        Run(EXTRACTED, "4", 1_000, 0),
        Run(WHITE, "4", 1_000, 0),
        Run(EXTRACTED, "4", 1_000, 1),
    ]
    assert [run.iterations for run in planned[-3:]] == [5_000] * 3


@pytest.mark.parametrize("kind", READING_OF, ids=str)
def test_each_kind_of_run_has_the_settings_of_the_reading_beside_it(kind):
    settings = settings_of(Run(*kind, 0), "full")
    for name, value in READINGS[READING_OF[kind]].items():
        assert getattr(settings, name) == value


def table(keys, rows):
    return pd.DataFrame(
        [(*row, *measured, value) for *row, value in rows for measured in MEASURED],
        columns=[*keys, "claim", "name", "value"],
    )


def test_the_table_has_medians_ranges_and_the_exact_test_of_both():
    his = table(KEYS, [(EXTRACTED, "4", 1_000, seed, seed) for seed in range(4)])
    author = [
        ("author's configuration", "oneDNN" if seed < 3 else "Eigen", seed, 10 + seed)
        for seed in range(4)
    ]
    others = [("author's configuration", "Eigen", 0, 99), ("base", "oneDNN", 0, 99)]
    ours = table(["reading", "rounding", "seed"], author + others)
    header, rows = beside(his, ours)
    assert len(rows) == len(MEASURED)
    # 2 of the 70 orders of four and four values are as extreme
    assert rows[0][2:] == ["1.5 (0 to 3; 4)", "11.5 (10 to 13; 4)", f"{2 / 70:.2g}"]
    assert FIGURES["beside"].draw({"pairs": pairs(his, ours)}).axes


@pytest.mark.parametrize("arguments", [[], ["--code", "no_such_file.py"]])
def test_without_his_file_the_study_says_where_it_is_published(arguments, capsys):
    assert main(arguments) == 2
    assert "github.com/pgfeldman/GAN_brownbag" in capsys.readouterr().err
