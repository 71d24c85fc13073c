"""The table of designs that were tried: one row a training, none made twice, on development seeds alone."""

import csv

import keras
import numpy as np
import pytest

from benchmarks import designs
from enhsim_tf.realism import MEASURES


def test_rows_are_made_once_and_hold_every_measure(tmp_path):
    options = ["--budget", "smoke", "--out", str(tmp_path / "tries.csv"), "--cache", str(tmp_path), "--environment", "white"]
    assert designs.main([*options, "--noise", "real noise"]) == 0
    first = (tmp_path / "tries.csv").read_text(encoding="utf-8")
    assert designs.main([*options, "--noise", "real noise", "--noise", "as it is"]) == 0
    second = (tmp_path / "tries.csv").read_text(encoding="utf-8")
    assert second.startswith(first)
    real, generated = rows = list(csv.DictReader(second.splitlines()))
    assert [row["noise"] for row in rows] == ["real noise", "as it is"] and {row["seed"] for row in rows} == {"110"}
    assert (real["iterations"], int(generated["iterations"]) > 0) == ("0", True)
    for row in rows:
        assert all(float(row[measure.name]) >= 0 for measure in MEASURES) and 0 <= float(row["false_alarms"]) <= 1
    # two iterations make no noise: what is real is nearer in nearly everything
    assert sum(float(real[measure.name]) < float(generated[measure.name]) for measure in MEASURES) > len(MEASURES) / 2


def test_a_design_differs_in_one_thing():
    noise = np.random.default_rng(0).normal(size=(40, 100)).astype(np.float32)
    made = {design: designs.untrained(design, noise, 10, 1) for design in designs.DESIGNS}
    assert {design: number for design, (_, number) in made.items()} == dict.fromkeys(designs.DESIGNS, 10) | {
        "four times the iterations": 40
    }
    losses = {design: type(gan.loss) for design, (gan, _) in made.items()}
    assert losses == dict.fromkeys(designs.DESIGNS, keras.losses.BinaryCrossentropy) | {"least squares loss": keras.losses.MeanSquaredError}
    weights = [[np.array(weight) for weight in gan.generator.weights] for gan, _ in made.values()]
    assert all(np.array_equal(one, first) for others in weights[1:] for one, first in zip(others, weights[0], strict=True))


@pytest.mark.parametrize("arguments", [["--seed", "2000"], ["--seed", "99"], ["--budget", "smoke"], ["--noise", "pink"]])
def test_wrong_options_are_refused(arguments, capsys):
    with pytest.raises(SystemExit, match="2"):
        designs.main(arguments)
    assert "error:" in capsys.readouterr().err
