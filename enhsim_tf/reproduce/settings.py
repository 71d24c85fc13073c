"""The settings of the reproduction, each with its unit and its source.

A value comes from the paper's text if the paper states it; otherwise from the author's public code (`OneDGAN2.py` of his
1-D GAN demo and `TF2_opt_example.py` of his optimiser's examples); otherwise it is this project's choice, and the source
gives the reason. Each question that the paper leaves open is a field that can be changed. The smoke budget changes counts
only: those of the fields that have a value for `smoke`.
"""

import dataclasses
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError

OUR_CHOICE = "our choice"
BUDGETS = ("smoke", "full")
LOCATION = "influxdb://telemetry/enhsim_tf/value"  # where `--store influxdb` places the telemetry


def setting(value: Any, unit: str, source: str, paper: str = "-", author: str = "-", smoke: Any = None) -> Any:
    """A dataclass field with its default value, its unit and its source.

    Args:
        value: The default value.
        unit: Its unit; for a value that is a word, the choices.
        source: Where the value comes from, and the reason if it is this project's choice.
        paper: What the paper says; `-` if it says nothing.
        author: What the author's public code says; `-` if it says nothing.
        smoke: The value in a smoke run, for counts; None if it stays the same.

    Returns:
        The field.
    """
    about = {"unit": unit, "source": source, "paper": paper, "author": author, "smoke": smoke}
    return dataclasses.field(default=value, metadata=about)


@dataclasses.dataclass(frozen=True)
class TelemetrySettings:
    """The example telemetry, its parts and its windows."""

    orbit_period_s: float = setting(480.0, "s", "paper, section 2", "8 min")
    rotation_period_s: float = setting(120.0, "s", "paper, section 2", "2 min")
    orbit_amplitude: float = setting(0.5, "1", f"{OUR_CHOICE}: the author scales real data to 0.5 under a tanh", "-", "0.5 for all")
    rotation_amplitude: float = setting(0.25, "1", f"{OUR_CHOICE}: half the orbit's amplitude, so that both waves are visible", "-")
    layout: str = setting(
        "sum",
        "sum or separate",
        f'{OUR_CHOICE}: the paper draws one signal; "separate" gives each series its own wave',
        '"signals"',
        "one function a row",
    )
    interval_s: float = setting(1.0, "s", f"{OUR_CHOICE}: a window of 500 samples then covers slightly more than one orbit", "-")
    noise_sd: float = setting(
        0.1,
        "1",
        f"{OUR_CHOICE}: white Gaussian noise, small compared with the waves and still visible",
        '"noise"',
        "noise added to every value",
    )
    num_samples: int = setting(
        2_073_600, "samples", f"{OUR_CHOICE}: 24 days, so that the test part has 1,000 disjoint windows", smoke=120_000
    )
    window: int = setting(500, "samples", "paper, section 2.3", "500", "a parameter")
    num_windows: int = setting(
        1_500, "windows", f'{OUR_CHOICE}: within the author\'s range, "a large number"', '"a large number"', "10-3,000", smoke=60
    )
    target: str = setting(
        "noisy",
        "noisy or clean",
        "paper, Figure 2: the target is the original; least squares averages out the noise",
        "the original waveform",
        "noisy",
    )

    def draw_noise(self, signal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws the noise of the example telemetry, float64 of the shape of the noiseless `signal`."""
        return rng.normal(0.0, self.noise_sd, signal.shape)


@dataclasses.dataclass(frozen=True)
class SplitSettings:
    """How a series is split by time; a window is left out between the parts."""

    train: float = setting(0.5, "share", f"{OUR_CHOICE}: the two parts after it need 1,000 disjoint windows each")
    calibration: float = setting(0.25, "share", f"{OUR_CHOICE}: thresholds of the detectors trained on real telemetry")
    test: float = setting(0.25, "share", f"{OUR_CHOICE}: all results are measured on this part")
    real_train: float = setting(
        0.7, "share", f"{OUR_CHOICE}: a real channel is short; the rest is the test part, and there is no calibration part"
    )


@dataclasses.dataclass(frozen=True)
class EnhancerSettings:
    """The enhancer, the paper's first network."""

    hidden_units: int = setting(3_200, "units", "paper, section 2.2", "3,200", "a parameter")
    num_hidden: int = setting(2, "layers", "paper, section 2.2: Hidden_1 and Hidden_2 between input and output", "2")
    epochs: int = setting(40, "epochs", "paper, section 2.2", "40", "a parameter", smoke=2)
    batch_size: int = setting(15, "windows", "paper, section 2.2", "15", "a parameter")
    learning_rate: float = setting(0.001, "1", f"{OUR_CHOICE}: Adam's default; 0.01 is large for 3,200 units", "-", "0.01")
    loss: str = setting("mean_squared_error", "loss", "author's code", "-", "mean squared error")
    initialiser: str = setting("he_uniform", "initialiser", "author's code", "-", "he_uniform")
    num_levels: int = setting(2, "levels", 'paper, section 1: "a square wave"', "square wave")


@dataclasses.dataclass(frozen=True)
class NoiseSettings:
    """The noise extraction and the noise GAN, the paper's second network."""

    moving_average: int = setting(
        25,
        "samples",
        f"{OUR_CHOICE}: short compared with the 2-minute wave, long compared with the correlation time of the noise",
        "pandas' rolling mean",
    )
    latent: int = setting(16, "elements", "paper, section 2.3", "16", "a parameter")
    latent_span: float = setting(1.0, "1", f"{OUR_CHOICE}: a standard normal draw", "-", "4 or 2 pi")
    generator_units: int = setting(64, "units", "paper, section 2.3", "64", "a parameter")
    generator_activation: str = setting("tanh", "activation", "author's code", "-", "tanh")
    filters: int = setting(500, "filters", "author's code", '"merges input from 4 rows"', "the window's length")
    filter_width: int = setting(20, "samples", "paper, section 2.3", "20", "20")
    stride: int = setting(4, "samples", "paper, section 2.3", "4", "4")
    narrow_units: int = setting(25, "units", "author's code, one of two files", '"progressively narrowed"', "25, or half the window")
    initialiser: str = setting("he_uniform", "initialiser", "author's code", "-", "he_uniform")
    dropout: float = setting(0.0, "share", "paper: not mentioned", "-", "0.3 after the convolution and the narrow layer")


@dataclasses.dataclass(frozen=True)
class AdversarialSettings:
    """How the generator and the discriminator of the noise GAN are trained."""

    batch_size: int = setting(200, "rows of each kind", "paper, section 2.3", "200", "a parameter")
    num_iterations: int = setting(1_000, "iterations", "paper, section 2.3", "about 1,000", "a parameter", smoke=20)
    num_rounds: int = setting(
        2,
        "times the iterations",
        f"{OUR_CHOICE}: claim C4 follows the noise beyond the paper's number; all else uses the networks at that number",
    )
    record_every: int = setting(100, "iterations", "paper, section 2.3", "100", "100", smoke=5)
    learning_rate: float = setting(0.001, "1", f"{OUR_CHOICE}: Adam's default", "Adam", "Adam, default")
    mixed_batch: bool = setting(False, "yes or no", "author's code: real rows, then generated rows", '"the entire batch"', "two updates")
    generated_in_training_mode: bool = setting(
        False, "yes or no", "author's code: batch normalisation in inference mode", "-", "inference mode"
    )


@dataclasses.dataclass(frozen=True)
class DetectorSettings:
    """The detectors that claims C3 and C8 are measured with, and the degraded modes of C9."""

    num_windows: int = setting(
        1_000, "windows", f"{OUR_CHOICE}: training windows of each arm; as many held-out windows set its threshold", smoke=60
    )
    false_alarm_rate: float = setting(
        0.01, "share", f"{OUR_CHOICE}: target rate of each threshold, on held-out windows of the training arm"
    )
    num_components: int = setting(20, "components", f"{OUR_CHOICE}: PCA residual; the waves take up to four components")
    num_trees: int = setting(200, "trees", f"{OUR_CHOICE}: size of the isolation forest")
    autoencoder_epochs: int = setting(30, "epochs", f"{OUR_CHOICE}: training of the dense autoencoder, 128-16-128 units", smoke=2)
    severity: float = setting(0.5, "from 0 to 1", f"{OUR_CHOICE}: the middle of the range, in each degraded mode")
    num_speed_windows: int = setting(2_048, "windows", f"{OUR_CHOICE}: number of windows that claim C2 times", smoke=256)


@dataclasses.dataclass(frozen=True)
class Settings:
    """All groups of settings, the budget and the seed."""

    telemetry: TelemetrySettings = TelemetrySettings()
    split: SplitSettings = SplitSettings()
    enhancer: EnhancerSettings = EnhancerSettings()
    noise: NoiseSettings = NoiseSettings()
    adversarial: AdversarialSettings = AdversarialSettings()
    detectors: DetectorSettings = DetectorSettings()
    budget: str = "full"
    seed: int = 0


def groups(settings: Settings) -> dict[str, Any]:
    """The groups of settings by name."""
    return {name: group for name in vars(settings) if dataclasses.is_dataclass(group := getattr(settings, name))}


def make_settings(budget: str = "full", seed: int = 0, kind: type[Settings] = Settings, **turned: Any) -> Settings:
    """The settings at a budget, with some of them changed.

    Args:
        budget: `full`, or `smoke` for the smaller counts.
        seed: Seed of all random draws.
        kind: `Settings`, or a class with further groups.
        **turned: Changed settings as `group__field=value`, for example `noise__dropout=0.3`.

    Raises:
        InputError: If the budget, a group or a field is unknown.
    """
    settings = kind(budget=budget, seed=seed)
    known = {f"{name}__{field.name}" for name, group in groups(settings).items() for field in dataclasses.fields(group)}
    unknown = sorted(set(turned) - known)
    if budget not in BUDGETS or unknown:
        received = f"budget={budget!r}" if budget not in BUDGETS else f"{unknown[0]}={turned[unknown[0]]!r}"
        raise InputError(f"Expected a budget of {' or '.join(BUDGETS)} and settings as group__field. Received: {received}.")
    for name, group in groups(settings).items():
        counts = {field.name: field.metadata["smoke"] for field in dataclasses.fields(group) if field.metadata["smoke"] is not None}
        chosen = {key.split("__", 1)[1]: value for key, value in turned.items() if key.split("__", 1)[0] == name}
        settings = dataclasses.replace(settings, **{name: dataclasses.replace(group, **((counts if budget == "smoke" else {}) | chosen))})
    return settings


def deviations() -> list[dict[str, str]]:
    """The deviations table: for each setting its value, the paper's and the author's value, and the source."""
    rows = []
    for name, group in groups(Settings()).items():
        for field in dataclasses.fields(group):
            about = field.metadata
            words = {"setting": f"{name}.{field.name}", "value": _in_words(field.default, about["unit"])}
            rows.append({**words, "paper": about["paper"], "author": about["author"], "source": about["source"]})
    return rows


def _in_words(value: Any, unit: str) -> str:
    if isinstance(value, str | bool):  # their unit lists the choices
        return {True: "yes", False: "no"}.get(value, value)
    if isinstance(value, tuple):
        return f"{', '.join(f'{each:,}' for each in value)} {unit}"
    number = f"{value:,}" if isinstance(value, int) else f"{value:,g}"
    return number if unit == "1" else f"{number} {unit}"
