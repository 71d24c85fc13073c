"""Every number of the reproduction, once, with its unit and its source.

Sources: the paper's text first; where it is silent, the author's public code (`OneDGAN2.py` of his 1-D GAN demo and
`TF2_opt_example.py` of his optimiser's examples); where that is silent too, ours, with the reason. Each open question of
the paper is a field that can be turned. A smoke budget changes counts only: the fields that say `smoke`.
"""

import dataclasses
from typing import Any

from enhsim_tf.common.errors import InputError

OURS = "ours"
BUDGETS = ("smoke", "full")
LOCATION = "influxdb://telemetry/enhsim_tf/value"  # where `--store influxdb` places the telemetry
FIGURES = (
    "fig01_pipeline",
    "fig02_source_target",
    "fig03_enhancer",
    "fig04_enhanced_simulation",
    "fig05_real_or_generated",
    "fig06_real_or_generated_noise",
    "fig07_real_or_generated_series",
    "fig08_source_noise",
    "fig09_generator",
    "fig10_discriminator",
    "fig11_gan_training",
    "fig12_accuracy_loss",
    "fig13_combined",
    "fig14_telemetry_store",
)


def setting(value: Any, unit: str, source: str, paper: str = "-", author: str = "-", smoke: Any = None) -> Any:
    """A field with its number and where that comes from.

    Args:
        value: The number.
        unit: Its unit; for words what the choices are.
        source: Where it comes from, and for ours the reason.
        paper: What the paper says.
        author: What the author's public code says.
        smoke: Its count in a smoke run, for counts.
    """
    about = {"unit": unit, "source": source, "paper": paper, "author": author, "smoke": smoke}
    return dataclasses.field(default=value, metadata=about)


@dataclasses.dataclass(frozen=True)
class TelemetrySettings:
    """The example telemetry, its parts and its windows."""

    orbit_period_s: float = setting(480.0, "s", "paper, section 2", "8 min")
    rotation_period_s: float = setting(120.0, "s", "paper, section 2", "2 min")
    orbit_amplitude: float = setting(0.5, "1", f"{OURS}: the author scales real data to 0.5 under a tanh", "-", "0.5 for all")
    rotation_amplitude: float = setting(0.25, "1", f"{OURS}: half the orbit's, so that both show", "-")
    layout: str = setting(
        "sum",
        "sum or separate",
        f'{OURS}: the paper draws one signal; "separate" gives each series its own wave',
        '"signals"',
        "one function a row",
    )
    interval_s: float = setting(1.0, "s", f"{OURS}: 500 samples are then one orbit and a little", "-")
    noise: str = setting("white", "process", f"{OURS}: the plainest; others in noise_processes", '"noise"')
    noise_sd: float = setting(0.1, "1", f"{OURS}: Gaussian, small against the waves, plain to the eye", "-", "noise added to every value")
    num_samples: int = setting(
        2_073_600, "samples", f"{OURS}: 24 days, so that a test has 1,000 windows that share no sample", smoke=120_000
    )
    window: int = setting(500, "samples", "paper, section 2.3", "500", "a parameter")
    num_windows: int = setting(
        1_500, "windows", f'{OURS}: within the author\'s range, "a large number"', '"a large number"', "10-3,000", smoke=60
    )
    target: str = setting(
        "noisy",
        "noisy or clean",
        "paper, Figure 2: the target is the original; least squares averages the noise away",
        "the original waveform",
        "noisy",
    )


@dataclasses.dataclass(frozen=True)
class SplitSettings:
    """How a series is split by time; a window is left out between the parts."""

    train: float = setting(0.5, "share", f"{OURS}: the two parts after it need 1,000 disjoint windows each")
    calibration: float = setting(0.25, "share", f"{OURS}: thresholds of the detectors trained on real telemetry")
    test: float = setting(0.25, "share", f"{OURS}: every figure of merit is measured here")
    real_train: float = setting(0.7, "share", f"{OURS}: a real channel is short; the rest is the test, with no calibration part")


@dataclasses.dataclass(frozen=True)
class EnhancerSettings:
    """Network one."""

    hidden_units: int = setting(3_200, "units", "paper, section 2.2", "3,200", "a parameter")
    num_hidden: int = setting(2, "layers", "paper, section 2.2: Hidden_1 and Hidden_2 between input and output", "2")
    epochs: int = setting(40, "epochs", "paper, section 2.2", "40", "a parameter", smoke=2)
    batch_size: int = setting(15, "windows", "paper, section 2.2", "15", "a parameter")
    learning_rate: float = setting(0.001, "1", f"{OURS}: Adam's default; 0.01 is large for 3,200 units", "-", "0.01")
    loss: str = setting("mean_squared_error", "loss", "author's code", "-", "mean squared error")
    initialiser: str = setting("he_uniform", "initialiser", "author's code", "-", "he_uniform")
    num_levels: int = setting(2, "levels", 'paper, section 1: "a square wave"', "square wave")


@dataclasses.dataclass(frozen=True)
class NoiseSettings:
    """The noise and network two."""

    moving_average: int = setting(25, "samples", f"{OURS}: short against the 2-minute wave, long against the noise", "pandas' rolling mean")
    latent: int = setting(16, "elements", "paper, section 2.3", "16", "a parameter")
    latent_span: float = setting(1.0, "1", f"{OURS}: a standard normal draw", "-", "4 or 2 pi")
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
    """How the two parts of network two are trained."""

    batch_size: int = setting(200, "rows of each kind", "paper, section 2.3", "200", "a parameter")
    num_iterations: int = setting(1_000, "iterations", "paper, section 2.3", "about 1,000", "a parameter", smoke=20)
    record_every: int = setting(100, "iterations", "paper, section 2.3", "100", "100", smoke=5)
    learning_rate: float = setting(0.001, "1", f"{OURS}: Adam's default", "Adam", "Adam, default")
    mixed_batch: bool = setting(False, "yes or no", "author's code: real rows, then generated rows", '"the entire batch"', "two updates")
    generated_in_training_mode: bool = setting(
        False, "yes or no", "author's code: batch normalisation in inference mode", "-", "inference mode"
    )


@dataclasses.dataclass(frozen=True)
class DetectorSettings:
    """The detectors that claims C3 and C8 are measured with, and the degraded modes of C9."""

    num_windows: int = setting(1_000, "windows", f"{OURS}: training windows of each arm; as many more set its threshold", smoke=60)
    false_alarm_rate: float = setting(0.01, "share", f"{OURS}: the rate each threshold is set for, on held-out windows of the arm")
    num_components: int = setting(20, "components", f"{OURS}: of the PCA residual; the waves take up to four")
    num_trees: int = setting(200, "trees", f"{OURS}: of the isolation forest")
    autoencoder_epochs: int = setting(30, "epochs", f"{OURS}: of the dense autoencoder 128-16-128", smoke=2)
    severity: float = setting(0.5, "from 0 to 1", f"{OURS}: the middle of the range, for each degraded mode")
    num_speed_windows: int = setting(2_048, "windows", f"{OURS}: timed in claim C2", smoke=256)


@dataclasses.dataclass(frozen=True)
class RobustnessSettings:
    """The experiment on robustness: `python -m enhsim_tf.reproduce --experiment robustness`."""

    num_seeds: int = setting(10, "seeds", f"{OURS}: a signed-rank test over 10 can reach p = 0.002", smoke=2)
    first_seed: int = setting(2_000, "seed", f"{OURS}: reporting seeds; designs were chosen on 100 to 199, and 1,000 was looked at")
    num_windows: int = setting(1_000, "windows", f"{OURS}: training windows of each arm; as many more set its threshold", smoke=200)
    num_anomalous: int = setting(150, "windows", f"{OURS}: of each kind and severity, paired over kinds, severities and arms", smoke=6)
    num_anomalous_varied: int = setting(30, "windows", f"{OURS}: the same, where noise scales and real shares are varied", smoke=3)
    num_resplits: int = setting(40, "re-splits", f"{OURS}: of the real-against-real floors, at most", smoke=5)
    num_trace_samples: int = setting(20_000, "samples", f"{OURS}: the continuous trace, two ranges of each kind", smoke=8_000)
    false_alarm_rate: float = setting(0.01, "share", f"{OURS}: the rate each threshold is set for, on held-out windows of the arm")
    max_order: int = setting(200, "samples", f"{OURS}: largest order of the fitted autoregression; AIC chooses", smoke=40)
    block: int = setting(250, "samples", f"{OURS}: of the block bootstrap; short blocks break what is correlated")


@dataclasses.dataclass(frozen=True)
class SecondSettings:
    """The second pipeline: noise is what the enhancer leaves, and a convolutional GAN learns it."""

    num_windows: int = setting(15_000, "windows", f"{OURS}: more windows, so that no noise of any stays in the enhancer", smoke=60)
    epochs: int = setting(2, "epochs", f"{OURS}: fewer epochs, half the paper's steps, at a rate that decays")
    held_out: float = setting(0.0, "share", f"{OURS}: coarse windows repeat, so the enhancer remembers the noise of none")


@dataclasses.dataclass(frozen=True)
class ModesSettings:
    """The degraded modes in full, a part of the experiment on robustness."""

    num_windows: int = setting(300, "windows", f"{OURS}: tested in each mode at each severity", smoke=40)
    windows_per_configuration: int = setting(50, "windows", f"{OURS}: so 300 configurations are drawn", smoke=5)


@dataclasses.dataclass(frozen=True)
class LabelledSettings:
    """The study of real telemetry with labelled anomalies: `python -m enhsim_tf.reproduce --experiment labelled`."""

    num_windows: int = setting(2_500, "windows", f"{OURS}: about every place in a channel of the data set once", smoke=60)
    epochs: int = setting(6, "epochs", f"{OURS}: 1,000 steps, a minute; more brought nothing", smoke=1)
    num_iterations: int = setting(1_000, "iterations", "paper, section 2.3", "around 1,000", smoke=4)
    num_arm_windows: int = setting(2_000, "windows", f"{OURS}: of each arm to learn from; as many set the threshold", smoke=200)
    false_alarm_rate: float = setting(0.01, "share", f"{OURS}: as in the experiment on robustness")
    max_order: int = setting(60, "samples", f"{OURS}: largest order of the fitted autoregression; AIC chooses", smoke=20)
    block: int = setting(50, "samples", f"{OURS}: of the block bootstrap: half a period")


@dataclasses.dataclass(frozen=True)
class Settings:
    """All of them, the budget and the seed."""

    telemetry: TelemetrySettings = TelemetrySettings()
    split: SplitSettings = SplitSettings()
    enhancer: EnhancerSettings = EnhancerSettings()
    noise: NoiseSettings = NoiseSettings()
    adversarial: AdversarialSettings = AdversarialSettings()
    detectors: DetectorSettings = DetectorSettings()
    second: SecondSettings = SecondSettings()
    robustness: RobustnessSettings = RobustnessSettings()
    modes: ModesSettings = ModesSettings()
    labelled: LabelledSettings = LabelledSettings()
    budget: str = "full"
    seed: int = 0


def groups(settings: Settings) -> dict[str, Any]:
    """The groups of settings by name."""
    return {name: group for name in vars(settings) if dataclasses.is_dataclass(group := getattr(settings, name))}


def make_settings(budget: str = "full", seed: int = 0, **turned: Any) -> Settings:
    """The settings at a budget, with some turned.

    Args:
        budget: `full`, or `smoke` for the smaller counts.
        seed: Seed of everything drawn.
        **turned: `group__field=value`, for example `noise__dropout=0.3`.

    Raises:
        InputError: If the budget, a group or a field is unknown.
    """
    settings = Settings(budget=budget, seed=seed)
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
    """The deviations table: for each setting ours, the paper's and the author's value, and the source of ours."""
    rows = []
    for name, group in groups(Settings()).items():
        for field in dataclasses.fields(group):
            about = field.metadata
            words = {"setting": f"{name}.{field.name}", "ours": _in_words(field.default, about["unit"])}
            rows.append({**words, "paper": about["paper"], "author": about["author"], "source": about["source"]})
    return rows


def _in_words(value: Any, unit: str) -> str:
    if isinstance(value, str | bool):  # their "unit" says what the choices are
        return {True: "yes", False: "no"}.get(value, value)
    number = f"{value:,}" if isinstance(value, int) else f"{value:,g}"
    return number if unit == "1" else f"{number} {unit}"
