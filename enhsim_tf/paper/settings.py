"""Every value of the reproduction: what the paper says, what the author's public code does, what is used here, and why.

A value comes from the paper's text. Where the text is silent, it comes from the author's public code; where that is silent too, it is
Keras' default; a choice of this project needs a reason. The smoke budget changes counts only.
"""

import dataclasses
from typing import Any

from enhsim_tf.common.errors import InputError

BUDGETS = ("smoke", "full")
PAPER, AUTHOR, OURS = "paper", "author's code", "our choice"
GAN_CODE = "pgfeldman/GAN_brownbag 50f5635, brownbag/OneDGAN2.py"
MLP_CODE = "pgfeldman/optevolver 3708ccc, examples/TF2_opt_example.py"

# longer reasons and quotations
LEARNING_RATE = "with 0.01, errors of 1.01, 0.26, 0.20, 0.16 and 0.17 after 40 epochs (seeds 0 to 4); with 0.001, 0.06 to 0.18"
INITIALISERS = "he_uniform in Dense 64 and Dense 25, else Keras' default, glorot_uniform"
AVERAGE = "pandas' default is trailing: it lags by 12 s and leaves 0.15 of the rotation's 0.25 in the noise"
SPAN = "4 by default, 2 pi in the demo; this variable also holds the range of the function to be learnt"
FILTERS = f"{GAN_CODE}; the 4 rows may be a slip for the stride, or 4 filters: filters=4"
UPDATE = '"trains on the entire batch (200 rows) of real and generated data"'
UPDATES = ("mixed 100 + 100", "mixed 200 + 200", "two of 200")


def setting(
    value: Any,
    stages: str,
    source: str,
    why: str = "",
    paper: str = "",
    author: str = "",
    unit: str = "",
    choices: tuple = (),
    smoke: Any = None,
) -> Any:
    """A field of `Settings`.

    Args:
        value: Its value at the full budget.
        stages: The stages whose results depend on it, separated by commas.
        source: `PAPER`, `AUTHOR` (a silence of which leaves Keras' default) or `OURS`.
        why: The section of the paper, the file of the author, or the reason.
        paper: What the paper says.
        author: What the author's public code does.
        unit: Unit of a number.
        choices: Values of a setting that is a word. The first one is the reference, the others are further readings.
        smoke: The value at the smoke budget, if it differs.
    """
    about = {
        "stages": tuple(stages.split(", ")),
        "source": source,
        "why": why,
        "paper": paper,
        "author": author,
    }
    return dataclasses.field(
        default=value, metadata=about | {"unit": unit, "choices": choices, "smoke": smoke}
    )


@dataclasses.dataclass(frozen=True)
class Settings:
    """All values of one run. `make_settings` changes some of them."""

    seed: int = setting(0, "all", OURS, "owns all random draws")

    # section 2: the telemetry
    orbit_period: float = setting(480.0, "telemetry", PAPER, "section 2", "8 minutes", unit="s")
    rotation_period: float = setting(120.0, "telemetry", PAPER, "section 2", "2 minutes", unit="s")
    orbit_amplitude: float = setting(
        0.5, "telemetry", AUTHOR, GAN_CODE, author="real data have amplitude 0.5 under a tanh"
    )
    rotation_amplitude: float = setting(
        0.25,
        "telemetry",
        OURS,
        "half the orbit's amplitude, so that both waves of the sum are visible",
    )
    noise_sd: float = setting(
        0.1,
        "telemetry",
        OURS,
        "Gaussian; small beside the waves and still visible",
        author="0.1 in a comment",
    )
    interval: float = setting(
        1.0, "telemetry", OURS, "500 samples then last slightly more than one orbit", unit="s"
    )
    num_samples: int = setting(
        2_073_600,
        "telemetry",
        OURS,
        "24 days: 1,000 disjoint test windows",
        unit="samples",
        smoke=120_000,
    )
    window: int = setting(
        500,
        "windows",
        PAPER,
        "section 2.3",
        '"the number of samples in the time series"',
        "100",
        unit="samples",
    )

    # section 2.2: the enhancer
    num_windows: int = setting(
        1_500,
        "windows",
        OURS,
        "15,000 is a reading",
        '"a large number"',
        "10 to 3,000",
        unit="windows",
        smoke=60,
    )
    hidden_units: int = setting(
        3_200, "enhancer", PAPER, "section 2.2", "3,200", "200", unit="units"
    )
    num_hidden: int = setting(
        2,
        "enhancer",
        PAPER,
        "section 2.2: Hidden_1 and Hidden_2 between input and output",
        "2",
        "1",
        unit="layers",
    )
    epochs: int = setting(
        40, "enhancer", PAPER, "section 2.2", "40", "10 to 100", unit="epochs", smoke=2
    )
    batch_size: int = setting(15, "enhancer", PAPER, "section 2.2", "15", "2 to 20", unit="windows")
    learning_rate: float = setting(
        0.001, "enhancer", OURS, LEARNING_RATE, author="0.01, for 200 units"
    )
    loss: str = setting(
        "mean_squared_error", "enhancer", AUTHOR, MLP_CODE, "", "mean squared error"
    )
    initialisers: str = setting(
        "by layer",
        "enhancer, noise GAN",
        AUTHOR,
        f"{GAN_CODE} and {MLP_CODE}",
        author=INITIALISERS,
        choices=("by layer", "he_uniform"),
    )

    # section 2.3: the noise and its GAN
    moving_average: int = setting(
        25,
        "noise",
        OURS,
        "short beside 2 minutes; edges are cut",
        "pandas' rolling mean",
        unit="samples",
    )
    average: str = setting(
        "centred", "noise", OURS, AVERAGE, "pandas' rolling mean", choices=("centred", "trailing")
    )
    latent: int = setting(16, "noise GAN", PAPER, "section 2.3", "16", "16", unit="elements")
    latent_scale: float = setting(
        1.0, "noise GAN", OURS, "a standard normal draw; 4 and 2 pi are readings", author=SPAN
    )
    generator_units: int = setting(64, "noise GAN", PAPER, "section 2.3", "64", "64", unit="units")
    generator_activation: str = setting("tanh", "noise GAN", AUTHOR, GAN_CODE, "", "tanh")
    filters: int = setting(
        500,
        "noise GAN",
        AUTHOR,
        FILTERS,
        '"merges input from 4 rows"',
        "the window's length",
        unit="filters",
    )
    filter_width: int = setting(
        20, "noise GAN", PAPER, "section 2.3", '"a window 20 neurons wide"', "20", unit="samples"
    )
    stride: int = setting(
        4, "noise GAN", PAPER, "section 2.3", '"a stride of 4 neurons"', "4", unit="samples"
    )
    narrow_units: int = setting(
        25,
        "noise GAN",
        AUTHOR,
        GAN_CODE,
        '"progressively narrowed"',
        "25, or half the window",
        unit="units",
    )
    dropout: float = setting(
        0.3,
        "noise GAN",
        AUTHOR,
        GAN_CODE,
        author="0.3 after the convolution and after the narrow layer",
    )
    rows: int = setting(
        200,
        "noise GAN",
        PAPER,
        "section 2.3",
        '"the entire batch (200 rows)"',
        "one number for all",
        unit="rows",
    )
    update: str = setting(
        "mixed 100 + 100",
        "noise GAN",
        PAPER,
        "section 2.3",
        UPDATE,
        "two updates, real then generated",
        choices=UPDATES,
    )
    gan_learning_rate: float = setting(0.001, "noise GAN", AUTHOR, GAN_CODE, "Adam", "Adam, 0.001")
    iterations: int = setting(
        1_000,
        "noise GAN",
        PAPER,
        "section 2.3",
        "around 1,000",
        "1,000",
        unit="iterations",
        smoke=20,
    )
    record_every: int = setting(
        100,
        "noise GAN",
        PAPER,
        "section 2.3",
        "100-step intervals",
        "100",
        unit="iterations",
        smoke=5,
    )
    rounds: int = setting(
        2,
        "noise GAN",
        OURS,
        "C4 follows training beyond the paper's number; all else uses the networks at it",
    )

    # how claims are measured
    detector_windows: int = setting(
        1_000,
        "claims",
        OURS,
        "to train a detector; as many set its threshold",
        unit="windows",
        smoke=60,
    )
    false_alarm_rate: float = setting(
        0.01,
        "claims",
        OURS,
        "of each threshold, on windows of the detector's own kind of training data",
    )
    num_components: int = setting(
        20, "claims", OURS, "of the PCA residual; the waves take up to four", unit="components"
    )
    num_trees: int = setting(200, "claims", OURS, "of the isolation forest", unit="trees")
    autoencoder_epochs: int = setting(
        30, "claims", OURS, "of the dense autoencoder, 128-16-128", unit="epochs", smoke=2
    )
    severity: float = setting(0.5, "claims", OURS, "the middle of the range, in each degraded mode")
    speed_windows: int = setting(
        2_048, "claims", OURS, "generated at a time when C2 is timed", unit="windows", smoke=256
    )

    fast: bool = setting(
        True,
        "enhancer, noise GAN",
        OURS,
        "faster steps, equal up to rounding but for the masks of dropout",
    )

    def of(self, *stages: str) -> dict[str, Any]:
        """The values on which the results of these stages depend, by name."""
        wanted = {"all", *stages}
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if wanted & {*field.metadata["stages"]}
        }

    @property
    def rows_of_each_kind(self) -> int:
        """Number of real rows, and of generated rows, from which the discriminator learns in one iteration."""
        return self.rows // 2 if self.update == "mixed 100 + 100" else self.rows


def make_settings(budget: str = "full", **changed: Any) -> Settings:
    """The settings at a budget, with some of them changed.

    Args:
        budget: `full`, or `smoke` for smaller counts.
        **changed: Values by name, for example `dropout=0`. Text is converted to the type of the setting.

    Raises:
        InputError: If the budget, a name or a value cannot be used.
    """
    fields = {field.name: field for field in dataclasses.fields(Settings)}
    if budget not in BUDGETS:
        raise InputError(f"Expected a budget of {' or '.join(BUDGETS)}. Received: {budget!r}.")
    if unknown := sorted(set(changed) - set(fields)):
        raise InputError(
            f"Expected one of the settings {', '.join(fields)}. Received: {unknown[0]!r}."
        )
    smaller = {
        name: field.metadata["smoke"]
        for name, field in fields.items()
        if budget == "smoke" and field.metadata["smoke"] is not None
    }
    settings = Settings(
        **smaller | {name: _converted(fields[name], value) for name, value in changed.items()}
    )
    if (
        settings.window < settings.filter_width
        or settings.iterations % settings.record_every
        or settings.dropout >= 1
    ):
        raise InputError(
            "Expected window of at least filter_width, iterations in multiples of record_every, and dropout below 1. "
            f"Received: window={settings.window}, iterations={settings.iterations}, dropout={settings.dropout}. Change one of them."
        )
    return settings


def _converted(field: dataclasses.Field, value: Any) -> Any:
    kind, choices = type(field.default), field.metadata["choices"]
    least = 1 if kind is int and field.name not in ("seed", "num_hidden") else 0
    end = 2**32 if field.name == "seed" else 1e12
    try:
        converted = (
            {"yes": True, "no": False, True: True, False: False}[value]
            if kind is bool
            else kind(value)
        )
        if (choices and converted not in choices) or (
            kind in (int, float) and not least <= converted < end
        ):
            raise ValueError
    except (KeyError, TypeError, ValueError):
        expected = " or ".join(choices) or {
            bool: "yes or no",
            int: f"a whole number from {least} to below {end:g}",
            float: "a number from 0",
        }.get(kind, "a word")
        raise InputError(f"Expected {field.name} to be {expected}. Received: {value!r}.") from None
    return converted
