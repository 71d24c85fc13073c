"""Tests units and sources of settings, the smoke budget, and that a setting exists for each open question of the paper."""

import dataclasses
import inspect
import re

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import Settings, deviations, groups, make_settings

FIELDS = {
    f"{name}.{field.name}": (getattr(group, field.name), field.metadata)
    for name, group in groups(Settings()).items()
    for field in dataclasses.fields(group)
}

# typed from the paper, section by section
PAPER = {
    "telemetry.orbit_period_s": 480,
    "telemetry.rotation_period_s": 120,
    "telemetry.window": 500,
    "enhancer.hidden_units": 3_200,
    "enhancer.num_hidden": 2,
    "enhancer.epochs": 40,
    "enhancer.batch_size": 15,
    "noise.latent": 16,
    "noise.generator_units": 64,
    "noise.filter_width": 20,
    "noise.stride": 4,
    "adversarial.batch_size": 200,
    "adversarial.num_iterations": 1_000,
    "adversarial.record_every": 100,
}
COUNTS = {
    "telemetry.num_samples",
    "telemetry.num_windows",
    "enhancer.epochs",
    "adversarial.num_iterations",
    "adversarial.record_every",
    "detectors.num_windows",
    "detectors.autoencoder_epochs",
    "detectors.num_speed_windows",
}


def _flat(settings):
    return {f"{name}.{key}": value for name, group in groups(settings).items() for key, value in vars(group).items()}


@pytest.mark.parametrize("name", FIELDS)
def test_each_setting_has_unit_and_source(name):
    about = FIELDS[name][1]
    assert about["unit"].strip()
    assert about["source"].startswith(("paper", "author's code", "our choice: "))
    if about["source"].startswith("author"):
        assert about["author"] != "-"
    if about["source"].startswith("our choice"):
        assert len(about["source"]) > len("our choice: ") + 10, "a choice needs its reason"


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_numbers(name):
    value, about = FIELDS[name]
    assert value == PAPER[name]
    assert about["source"].startswith("paper, section 2")


def test_groups_are_frozen_and_small():
    for group in groups(Settings()).values():
        assert 1 <= len(dataclasses.fields(group)) <= 12
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(group, dataclasses.fields(group)[0].name, 0)


def test_smoke_changes_counts_only():
    full, smoke = _flat(make_settings("full")), _flat(make_settings("smoke"))
    assert full == {name: value for name, (value, _) in FIELDS.items()}
    assert {name for name in full if full[name] != smoke[name]} == COUNTS
    for name in COUNTS:
        assert type(smoke[name]) is type(full[name])
        if isinstance(full[name], tuple):  # a list of counts
            assert set(map(type, full[name])) == {int} and 0 < max(smoke[name]) < max(full[name]) and len(smoke[name]) < len(full[name])
        else:
            assert type(full[name]) is int and 0 < smoke[name] < full[name]


def test_changing_one_setting_changes_no_other():
    for budget in ("full", "smoke"):
        before, after = _flat(make_settings(budget, 3)), _flat(make_settings(budget, 3, noise__dropout=0.3))
        assert {name for name in before if before[name] != after[name]} == {"noise.dropout"}
        assert after["noise.dropout"] == 0.3
    turned = make_settings("smoke", 3, enhancer__epochs=7)
    assert (turned.enhancer.epochs, turned.budget, turned.seed) == (7, "smoke", 3), "what is turned goes before the budget's count"


@pytest.mark.parametrize("turned", [{"nois__dropout": 0.3}, {"noise__dropuot": 0.3}, {"dropout": 0.3}, {"noise": 0.3}, {"seeds__x": 1}])
def test_an_unknown_setting_is_refused(turned):
    with pytest.raises((TypeError, InputError)):
        make_settings("smoke", **turned)


def test_an_unknown_budget_is_refused():
    with pytest.raises((ValueError, TypeError)):
        make_settings("half")


def test_the_library_knows_the_same_defaults():
    from enhsim_tf.coarse_simulator import square_waves
    from enhsim_tf.detection import detectors
    from enhsim_tf.detection.autoencoders import DenseAutoencoder
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.enhancer.network import build_enhancer
    from enhsim_tf.keras_tools.training import fit_windows
    from enhsim_tf.noise.discriminator import build_discriminator
    from enhsim_tf.noise.extraction import extract_noise
    from enhsim_tf.noise.gan import NoiseGAN
    from enhsim_tf.noise.generator import build_generator

    same = {
        build_enhancer: {"window": "telemetry.window", "hidden_units": "enhancer.hidden_units", "num_hidden": "enhancer.num_hidden"},
        fit_windows: {"learning_rate": "enhancer.learning_rate"},
        build_generator: {
            "window": "telemetry.window",
            "latent": "noise.latent",
            "hidden_units": "noise.generator_units",
            "activation": "noise.generator_activation",
        },
        build_discriminator: {
            "window": "telemetry.window",
            "filters": "noise.filters",
            "width": "noise.filter_width",
            "stride": "noise.stride",
            "narrow_units": "noise.narrow_units",
            "dropout": "noise.dropout",
        },
        NoiseGAN: {
            "batch_size": "adversarial.batch_size",
            "learning_rate": "adversarial.learning_rate",
            "latent_span": "noise.latent_span",
            "mixed_batch": "adversarial.mixed_batch",
            "generated_in_training_mode": "adversarial.generated_in_training_mode",
        },
        NoiseGAN.fit: {"num_iterations": "adversarial.num_iterations", "record_every": "adversarial.record_every"},
        extract_noise: {"width": "noise.moving_average"},
        EnhancedSimulator.fit: {"window": "telemetry.window"},
        detectors.PCAResidual: {"num_components": "detectors.num_components"},
        detectors.IsolationForestOnFeatures: {"num_trees": "detectors.num_trees"},
        DenseAutoencoder: {"epochs": "detectors.autoencoder_epochs"},
        square_waves.Degraded: {"severity": "detectors.severity"},
        square_waves.SquareWave: {"num_levels": "enhancer.num_levels"},
        square_waves.SquareWaveSimulator.fit: {"num_levels": "enhancer.num_levels"},
    }
    for function, names in same.items():
        parameters = inspect.signature(function).parameters
        for parameter, name in names.items():
            assert parameters[parameter].default == FIELDS[name][0], f"{function.__qualname__}({parameter}) and {name}"


# each open question of the paper, and how the name of its setting must read
OPEN_QUESTIONS = {
    "one series or two": "layout",
    "sampling interval": "interval_s",
    "amplitudes": "amplitude",
    "noise level": "noise_sd",
    "coarse source": "num_levels",
    "target of the enhancer": "target",
    "number of training windows": r"telemetry\.num_windows",
    "the four Dense layers": "num_hidden",
    "enhancer's loss": r"enhancer\..*loss",
    "enhancer's learning rate": r"enhancer\.learning_rate",
    "width of the moving average": "moving_average",
    "convolution filters": "filters",
    "dropout": "dropout",
    "narrow layer": "narrow",
    "generator's last activation": "generator_activation",
    "latent scale": "latent_span",
    "discriminator update": "mixed_batch",
    "mode of the generated rows": "training_mode",
    "dense initialiser": "initiali[sz]er",
}


@pytest.mark.parametrize("question", OPEN_QUESTIONS)
def test_each_open_question_is_a_setting(question):
    assert any(re.search(OPEN_QUESTIONS[question], name) for name in FIELDS)


def test_deviations_have_a_row_a_setting():
    rows = deviations()
    assert [row["setting"] for row in rows] == list(FIELDS)
    by_name = {row["setting"]: row for row in rows}
    assert by_name["enhancer.hidden_units"] == {
        "setting": "enhancer.hidden_units",
        "value": "3,200 units",
        "paper": "3,200",
        "author": "a parameter",
        "source": "paper, section 2.2",
    }
    values = {
        name: by_name[name]["value"]
        for name in ("noise.latent_span", "telemetry.layout", "adversarial.mixed_batch", "telemetry.num_samples")
    }
    assert list(values.values()) == ["1", "sum", "no", "2,073,600 samples"], "a bare number has no unit to name, a choice neither"


# -- each open question, turned, on networks small enough for a test -------------------------------------------------------

TINY = {
    "telemetry__num_samples": 8_000,
    "telemetry__num_windows": 12,
    "enhancer__hidden_units": 4,
    "enhancer__epochs": 1,
    "enhancer__batch_size": 6,
    "noise__filters": 4,
    "noise__generator_units": 4,
    "adversarial__batch_size": 8,
    "adversarial__num_iterations": 3,
    "adversarial__record_every": 1,
}
BOTH, ENHANCER, NOISE = ("enhancer", "noise"), ("enhancer",), ("noise",)
VARIANTS = {
    "telemetry__layout": ("separate", BOTH),
    "telemetry__interval_s": (2.0, ENHANCER),
    "telemetry__orbit_amplitude": (0.4, ENHANCER),
    "telemetry__noise_sd": (0.3, NOISE),
    "telemetry__target": ("clean", ENHANCER),
    "enhancer__num_levels": (6, ENHANCER),
    "enhancer__num_hidden": (1, ENHANCER),
    "enhancer__learning_rate": (0.01, ENHANCER),
    "noise__moving_average": (51, NOISE),
    "noise__latent_span": (4.0, NOISE),
    "noise__generator_activation": ("linear", NOISE),
    "noise__filters": (6, NOISE),
    "noise__narrow_units": (250, NOISE),
    "noise__dropout": (0.3, NOISE),
    "adversarial__mixed_batch": (True, NOISE),
    "adversarial__generated_in_training_mode": (True, NOISE),
}


@pytest.fixture(scope="module")
def run_tiny(tmp_path_factory):
    """Trains networks at tiny counts with settings turned; the variants share a cache, as runs of the command do."""
    cache = tmp_path_factory.mktemp("cache")

    def run(networks, seed=0, **turned):
        stages = Stages(cache, tell=lambda line: None)
        experiment = Experiment(make_settings("full", seed, **(TINY | turned)), stages)
        losses = {"enhancer": lambda: experiment.enhancer_history["loss"], "noise": lambda: experiment.noise_history["loss_generated"]}
        return {network: losses[network]() for network in networks}, stages.cached

    return run


@pytest.mark.parametrize("setting", VARIANTS)
def test_a_changed_setting_runs_and_changes_the_result(run_tiny, setting):
    value, moved = VARIANTS[setting]
    assert FIELDS[setting.replace("__", ".")][0] != value
    (base, _), (turned, _) = run_tiny(moved), run_tiny(moved, **{setting: value})
    for network in moved:
        assert np.isfinite(turned[network]).all()
        assert not np.array_equal(base[network], turned[network])


@pytest.mark.parametrize(
    ("setting", "done", "anew"), [("enhancer__epochs", "noise GAN", "enhancer"), ("noise__latent", "enhancer", "noise GAN")]
)
def test_unaffected_stages_are_found_in_the_cache(run_tiny, setting, done, anew):
    run_tiny(BOTH)
    _, cached = run_tiny(BOTH, **{setting: 2})
    assert cached["telemetry"] and cached[done] and not cached[anew]


def test_another_seed_gives_another_run(run_tiny):
    (first, _), (second, _) = run_tiny(BOTH), run_tiny(BOTH, seed=1)
    for network in BOTH:
        assert not np.array_equal(first[network], second[network])
