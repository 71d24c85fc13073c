"""The table of compared designs: one row for each training, no row computed twice, and development seeds only."""

import csv

import keras
import numpy as np
import pytest

from benchmarks import designs
from enhsim_tf.realism.real_floor import MEASURES


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
    # the few iterations of the smoke budget make no noise: what is real is nearer in most
    assert sum(float(real[measure.name]) < float(generated[measure.name]) for measure in MEASURES) > len(MEASURES) / 2


def test_a_design_differs_in_one_thing():
    noise = np.random.default_rng(0).normal(size=(40, 100)).astype(np.float32)
    made = {design: designs.untrained(design, noise, 10, 1) for design in designs.DESIGNS}
    assert {design: number for design, (_, number) in made.items()} == dict.fromkeys(designs.DESIGNS, 10) | {designs.LONGER: 40}
    losses = {design: type(gan.loss) for design, (gan, _) in made.items()}
    assert losses == dict.fromkeys(designs.DESIGNS, keras.losses.BinaryCrossentropy) | {
        designs.LEAST_SQUARES: keras.losses.MeanSquaredError
    }
    weights = [[weight.numpy() for weight in gan.generator.weights] for gan, _ in made.values()]
    assert all(np.array_equal(one, first) for others in weights[1:] for one, first in zip(others, weights[0], strict=True))
    pools = {design: [layer.name for layer in gan.discriminator.layers if "pooling" in layer.name] for design, (gan, _) in made.items()}
    assert {design: len(names) for design, names in pools.items()} == dict.fromkeys(designs.DESIGNS, 3) | {designs.MAXIMUM: 1}


@pytest.mark.parametrize("design", [designs.TAILS, designs.MAXIMUM, designs.LEAST_SQUARES])
def test_a_changed_design_trains_both_of_its_networks(design):
    noise = np.random.default_rng(0).normal(size=(40, 100)).astype(np.float32)
    gan, number = designs.untrained(design, noise, 2, 1)
    networks = (gan.generator, gan.discriminator)
    before = [[weight.numpy() for weight in network.trainable_weights] for network in networks]
    gan.fit(noise, number, verbose=False)
    for network, weights in zip(networks, before, strict=True):
        assert not any(np.array_equal(now.numpy(), then) for now, then in zip(network.trainable_weights, weights, strict=True))


def test_heavier_tails_have_the_moments_of_tukeys_distribution():
    """The white channel's variance is (1 - 2h)^(-3/2) (Martinez and Iglewicz 1984); slow channels pass unchanged."""
    inputs = keras.Input((None, 2))
    draws = np.random.default_rng(3).normal(size=(20, 50_000, 2)).astype(np.float32)
    heavy = designs.heavy_tailed(keras.Model(inputs, keras.layers.Identity()(inputs)), 1, weight=0.1).predict(draws, verbose=0)
    assert np.array_equal(heavy[:, :, 1], draws[:, :, 1])
    assert heavy[:, :, 0].astype(float).var() == pytest.approx((1 - 2 * 0.1) ** -1.5, rel=0.01)
    assert (np.diff(heavy[0, np.argsort(draws[0, :, 0]), 0]) >= 0).all(), "order is kept"


@pytest.mark.parametrize(
    "arguments", [["--seed", "2000"], ["--seed", "99"], ["--budget", "smoke"], ["--noise", "pink"], ["--environment", "pink"]]
)
def test_wrong_options_are_refused(arguments, capsys):
    with pytest.raises(SystemExit, match="2"):
        designs.main(arguments)
    assert "error:" in capsys.readouterr().err
