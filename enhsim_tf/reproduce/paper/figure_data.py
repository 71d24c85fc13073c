"""The arrays behind each figure.

Each function takes the `Experiment` and returns plain arrays by name: numbers as arrays of shape `()` and text as unicode
arrays, so that `numpy.savez` stores them without pickle. It requests only the stages that its figure needs, so a figure of
windows or of the layers of a network trains nothing.
"""

import collections
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.enhancer.training_pairs import paired_windows
from enhsim_tf.noise.extraction import extract_noise
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.telemetry.series import Telemetry

if TYPE_CHECKING:
    from enhsim_tf.keras_tools.backend import keras

Arrays = dict[str, np.ndarray]

_LONG_STRETCH = 3_000  # samples of a strip of figure 7: six windows of the paper's example
_STORE_STRETCH = 3_600  # samples of figure 14: an hour of the paper's example


def pipeline(experiment: Experiment) -> Arrays:
    """Figure 1: the waveforms of one held-out window in each step, and the widths of the networks."""
    simulator, data = experiment.simulator, combined(experiment)
    held_out = _windows(experiment, "test", 1, "figure 13")
    noise, _ = _noise_of(experiment, held_out["offset"][0])
    latent = experiment.data.draw("figure 1").standard_normal(simulator.noise.generator.input_shape[1])
    networks = {"enhancer": simulator.enhancer, "generator": simulator.noise.generator, "discriminator": simulator.noise.discriminator}
    widths = {
        f"{name}_units": np.array([layer.units for layer in model.layers if hasattr(layer, "units")]) for name, model in networks.items()
    }
    generated = data["combined"] - data["enhanced"]
    return data | widths | {"noise": noise, "generated_noise": generated, "latent": latent.astype(np.float32)}


def source_target(experiment: Experiment) -> Arrays:
    """Figure 2: pairs of training windows, coarse source and recorded target, and where in the series they begin."""
    pairs = _windows(experiment, "train", 3, "figure 2")
    telemetry = experiment.data.channels[0].telemetry
    begin = experiment.data.channels[0].train.time_s[pairs["offset"]]
    return {"source": pairs["coarse"], "target": pairs["target"], "begin": begin, "begin_unit": np.array(telemetry.time_unit)} | _axis(
        experiment
    )


def enhanced_simulation(experiment: Experiment) -> Arrays:
    """Figure 4: a held-out window, coarse and enhanced, beside the truth, and the errors over all test windows."""
    window = {key: values[0] for key, values in _windows(experiment, "test", 1, "figure 4").items()}
    enhanced = experiment.simulator.enhance(window["coarse"][None])[0]
    errors = {key: experiment.enhancement[key] for key in ("nrmse", "identity_nrmse", "ridge_nrmse")}
    shown = {key: window[key] for key in ("coarse", "truth")} | {"enhanced": enhanced}
    return shown | errors | _axis(experiment) | {"truth_is_known": np.array(experiment.data.channels[0].truth is not None)}


def real_or_generated(experiment: Experiment) -> Arrays:
    """Figure 5: windows of real and of generated telemetry, shuffled."""
    rng = experiment.data.draw("figure 5")
    real = _windows(experiment, "test", 4, "figure 5, real")["target"]
    return _shuffled(real, experiment.simulator.generate(4, seed=_seed(rng)), rng) | _axis(experiment)


def real_or_generated_noise(experiment: Experiment) -> Arrays:
    """Figure 6: windows of real and of generated noise, shuffled, and the effective ranks of many of each."""
    rng = experiment.data.draw("figure 6")
    real = experiment.data.noise_windows("test", 4, "figure 6, real")
    shuffled = _shuffled(real, experiment.simulator.noise.generate(4, seed=_seed(rng)), rng)
    measured = experiment.resemblance
    ranks = {
        "rank_generated": measured["noise_rank"],
        "rank_real": measured["noise_real_rank"],
        "rank_windows": measured["noise_num_windows"],
    }
    return shuffled | ranks | _axis(experiment)


def real_or_generated_series(experiment: Experiment) -> Arrays:
    """Figure 7: long stretches of held-out telemetry and as many generated ones of the same times, shuffled."""
    rng, test = experiment.data.draw("figure 7"), experiment.data.channels[0].test
    length = min(_LONG_STRETCH, len(test))
    begins = np.arange(min(2, len(test) // length)) * (len(test) - length)  # a real channel may be long enough for one only
    real = np.stack([test.values[begin : begin + length] for begin in begins])
    generated = [experiment.simulator.generate_series(length, seed=_seed(rng), start_s=test.time_s[begin]) for begin in begins]
    return _shuffled(real, np.stack(generated), rng) | _axis(experiment, length)


def source_noise(experiment: Experiment) -> Arrays:
    """Figure 8: training telemetry with its moving average, the noise that is left, and its sd over the training part."""
    window = _windows(experiment, "train", 1, "figure 8")
    noise, average = _noise_of(experiment, window["offset"][0], "train")
    width = experiment.settings.noise.moving_average
    deviation = np.std(extract_noise(experiment.data.channels[0].train.values, width)[0])
    shown = {"telemetry": window["target"][0], "average": average, "noise": noise}
    return shown | {"standard_deviation": deviation, "width": np.array(width)} | _axis(experiment)


def enhancer_layers(experiment: Experiment) -> Arrays:
    """Figure 3: the layers of the enhancer."""
    return _layers(experiment.untrained_enhancer())


def generator_layers(experiment: Experiment) -> Arrays:
    """Figure 9: the layers of the generator."""
    return _layers(experiment.untrained_noise_networks()[0])


def discriminator_layers(experiment: Experiment) -> Arrays:
    """Figure 10: the layers of the discriminator."""
    return _layers(experiment.untrained_noise_networks()[1])


def gan_training(experiment: Experiment) -> Arrays:
    """Figure 11: the numbers of the adversarial training."""
    training = experiment.settings.adversarial
    numbers = {"batch_size": training.batch_size, "num_iterations": training.num_iterations, "latent": experiment.settings.noise.latent}
    return {key: np.array(value) for key, value in numbers.items()} | {"mixed_batch": np.array(training.mixed_batch)}


def accuracy_loss(experiment: Experiment) -> Arrays:
    """Figure 12: accuracy and loss of the discriminator on real and on generated noise, by iteration."""
    measures = [f"{measure}_{kind}" for measure in ("accuracy", "loss") for kind in ("real", "generated")]
    return {key: experiment.noise_history[key] for key in ("iteration", *measures)}


def combined(experiment: Experiment) -> Arrays:
    """Figure 13: a held-out window: coarse, enhanced, enhanced with noise, and the telemetry of the same times."""
    window = {key: values[0] for key, values in _windows(experiment, "test", 1, "figure 13").items()}
    enhanced = experiment.simulator.enhance(window["coarse"][None])[0]
    noise = experiment.simulator.noise.generate(1, seed=_seed(experiment.data.draw("figure 13, noise")))[0]
    shown = {"coarse": window["coarse"], "enhanced": enhanced, "combined": enhanced + noise, "telemetry": window["target"]}
    return shown | _axis(experiment)


def telemetry_store(experiment: Experiment) -> Arrays:
    """Figure 14: the beginning of the series as the store holds it, with its timestamps where the source has them."""
    series = experiment.store.read(experiment.store.names()[0])
    stretch = series.part(0, min(_STORE_STRETCH, len(series)))
    time = stretch.time_s
    if series.has_time:
        start = np.datetime64(series.start.removesuffix("+00:00"), "ms")
        time = start + np.round(1e3 * stretch.time_s).astype("timedelta64[ms]")
    about = {"name": series.name, "num_samples": len(series), "interval_s": series.interval_s, "unit": _unit(experiment, series)}
    return {"time": time, "values": stretch.values} | {key: np.array(value) for key, value in about.items()}


FIGURE_DATA: dict[str, Callable[[Experiment], Arrays]] = {
    "fig01_pipeline": pipeline,
    "fig02_source_target": source_target,
    "fig03_enhancer": enhancer_layers,
    "fig04_enhanced_simulation": enhanced_simulation,
    "fig05_real_or_generated": real_or_generated,
    "fig06_real_or_generated_noise": real_or_generated_noise,
    "fig07_real_or_generated_series": real_or_generated_series,
    "fig08_source_noise": source_noise,
    "fig09_generator": generator_layers,
    "fig10_discriminator": discriminator_layers,
    "fig11_gan_training": gan_training,
    "fig12_accuracy_loss": accuracy_loss,
    "fig13_combined": combined,
    "fig14_telemetry_store": telemetry_store,
}
WITHOUT_TRAINING = (
    "fig02_source_target",
    "fig03_enhancer",
    "fig08_source_noise",
    "fig09_generator",
    "fig10_discriminator",
    "fig11_gan_training",
    "fig14_telemetry_store",
)
"""Figures that need no trained network and can be drawn before training."""


# -- shared helpers ---------------------------------------------------------------------------------------------


def _windows(experiment: Experiment, part: str, num_windows: int, purpose: str) -> Arrays:
    """Windows of the first channel, spread over a part: one at a random offset of each equal share of it."""
    channel, window = experiment.data.channels[0], experiment.data.window
    series: Telemetry = getattr(channel, part)
    shares = (np.arange(num_windows) + experiment.data.draw(purpose).random(num_windows)) / num_windows
    offsets = (shares * (len(series) - window + 1)).astype(np.int64)
    coarse, target = paired_windows(series, channel.coarse, offsets, window)
    times = series.time_s[offsets[:, None] + np.arange(window)]
    truth = target if channel.truth is None else channel.truth(times).astype(np.float32)
    return {"coarse": coarse, "target": target, "truth": truth, "offset": offsets}


def _noise_of(experiment: Experiment, offset: int, part: str = "test") -> tuple[np.ndarray, np.ndarray]:
    """Noise and moving average of one window of a part; NaN where the part's edge leaves no full average."""
    series, window, width = getattr(experiment.data.channels[0], part), experiment.data.window, experiment.settings.noise.moving_average
    half = width // 2
    noise, average = (np.pad(values, half, constant_values=np.nan) for values in extract_noise(series.values, width))
    return noise[offset : offset + window], average[offset : offset + window]


def _axis(experiment: Experiment, num_samples: int | None = None) -> Arrays:
    """The time axis of a window or a longer stretch, from 0, in a unit that suits its length, and the values' unit."""
    telemetry = experiment.data.channels[0].telemetry
    time, unit, size = telemetry.interval_s * np.arange(num_samples or experiment.data.window), telemetry.time_unit, 1
    if telemetry.has_time:
        units = {"s": 1, "min": 60, "h": 3_600, "d": 86_400}
        unit, size = next((item for item in units.items() if time[-1] < 300 * item[1]), ("d", 86_400))
    return {"time": time / size, "time_unit": np.array(unit), "unit": _unit(experiment, telemetry)}


def _unit(experiment: Experiment, series: Telemetry) -> np.ndarray:
    """The unit of the values as text; most files do not give it."""
    unit = series.unit
    return np.array(unit if unit != "1" else "dimensionless" if experiment.is_paper else "as recorded")


def _shuffled(real: np.ndarray, generated: np.ndarray, rng: np.random.Generator) -> Arrays:
    """Real and generated rows in random order, and which rows are generated."""
    is_generated = np.repeat([False, True], [len(real), len(generated)])
    order = rng.permutation(len(is_generated))
    return {"rows": np.concatenate([real, generated])[order], "is_generated": is_generated[order]}


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _layers(model: "keras.Model") -> Arrays:
    """A Keras model as a table, one row per layer."""
    rows = {
        "layer": _names(model.layers),
        "type": [type(layer).__name__ for layer in model.layers],
        "detail": [_detail(layer) for layer in model.layers],
        "output_shape": [str(tuple(layer.output.shape)) for layer in model.layers],
        "parameters": [layer.count_params() for layer in model.layers],
        "input_shape": str(tuple(model.input_shape)),
        "total": model.count_params(),
        "trainable": sum(int(np.prod(weight.shape)) for weight in model.trainable_weights),
    }
    return {key: np.array(values) for key, values in rows.items()}


def _names(layers: Sequence) -> list[str]:
    """Names of layers. Those that Keras makes up count what the process has made, so tell what came from the cache; here the network's."""
    names, made_up = [], collections.Counter()
    for layer in layers:
        root = re.sub(r"_\d+$", "", layer.name)
        if root.replace("_", "") == type(layer).__name__.lower():
            names.append(f"{root}_{made_up[root]}" if made_up[root] else root)
            made_up[root] += 1
        else:
            names.append(layer.name)
    return names


_MEANING = {
    "BatchNormalization": "to mean 0, variance 1",
    "GlobalMaxPooling1D": "largest value of each filter",
    "Reshape": "to the discriminator's input",
}


def _detail(layer: "keras.layers.Layer") -> str:
    """What a layer does, in words, from its class and its configuration."""
    config, words = layer.get_config(), []
    if type(layer).__name__ in _MEANING:
        words.append(_MEANING[type(layer).__name__])
    if "kernel_size" in config:
        words += [f"{config['filters']:,} filters", f"window {config['kernel_size'][0]}", f"stride {config['strides'][0]}"]
    if config.get("activation"):
        words.append(config["activation"])
    if "rate" in config:
        words.append(f"rate {config['rate']:g}")
    return ", ".join(words)
