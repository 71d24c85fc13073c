"""Every value that the paper gives or leaves open: what it says, what the author's public code
does, what is used here, and why.

A value comes from the paper's text. Where the text is silent, it comes from the author's public
code; where that is silent too, it is Keras' default; a choice of this project needs a reason. The
smoke budget changes counts only.
"""

import dataclasses
import functools
from typing import Any

from enhsim_tf.common.errors import InputError

YES_NO = {"yes": True, "no": False, True: True, False: False}
BUDGETS = ("smoke", "full")
PAPER = "paper"
AUTHOR = "author's code"
OURS = "our choice"
GAN_CODE = "pgfeldman/GAN_brownbag 50f5635, brownbag/OneDGAN2.py"
MLP_CODE = "pgfeldman/optevolver 3708ccc, examples/TF2_opt_example.py"


def setting(
    value: Any,
    *,
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
        stages: The groups of results that depend on it, separated by commas.
        source: `PAPER`, `AUTHOR` (a silence of which leaves Keras' default) or `OURS`.
        why: The section of the paper, the file of the author, or the reason.
        paper: What the paper says.
        author: What the author's public code does.
        unit: Unit of a number.
        choices: Values of a setting that is a word. The first one is the reference, the others are
            further readings.
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


# what many settings share
gan_of_paper = functools.partial(setting, stages="noise GAN", source=PAPER, why="section 2.3")
gan_of_author = functools.partial(setting, stages="noise GAN", source=AUTHOR, why=GAN_CODE)
enhancer_of_paper = functools.partial(setting, stages="enhancer", source=PAPER, why="section 2.2")
of_claims = functools.partial(setting, stages="claims", source=OURS)
of_telemetry = functools.partial(setting, stages="telemetry", source=OURS)


@dataclasses.dataclass(frozen=True)
class Settings:
    """All values of one run. `make_settings` changes some of them."""

    seed: int = setting(0, stages="all", source=OURS, why="owns all random draws")

    # section 2: the telemetry
    orbit_period: float = setting(
        480.0, stages="telemetry", source=PAPER, why="section 2", paper="8 minutes", unit="s"
    )
    rotation_period: float = setting(
        120.0, stages="telemetry", source=PAPER, why="section 2", paper="2 minutes", unit="s"
    )
    orbit_amplitude: float = setting(
        0.5,
        stages="telemetry",
        source=AUTHOR,
        why=GAN_CODE,
        author="real data have amplitude 0.5 under a tanh",
    )
    rotation_amplitude: float = of_telemetry(
        0.25, why="half the orbit's amplitude, so that both waves of the sum are visible"
    )
    noise_sd: float = of_telemetry(
        0.1, why="Gaussian; small beside the waves and still visible", author="0.1 in a comment"
    )
    interval: float = of_telemetry(
        1.0, why="500 samples then last slightly more than one orbit", unit="s"
    )
    num_samples: int = of_telemetry(
        2_073_600, why="24 days: 1,000 disjoint test windows", unit="samples", smoke=120_000
    )
    window: int = setting(
        500,
        stages="windows",
        source=PAPER,
        why="section 2.3",
        paper='"the number of samples in the time series"',
        author="100",
        unit="samples",
    )

    # section 2.2: the enhancer
    num_windows: int = setting(
        1_500,
        stages="enhancer",
        source=OURS,
        why="15,000 is a reading",
        paper='"a large number"',
        author="tens to hundreds",
        unit="windows",
        smoke=60,
    )
    hidden_units: int = enhancer_of_paper(3_200, paper="3,200", author="200", unit="units")
    num_hidden: int = setting(
        2,
        stages="enhancer",
        source=PAPER,
        why="section 2.2: Hidden_1 and Hidden_2 between input and output",
        paper="2",
        author="1",
        unit="layers",
    )
    epochs: int = enhancer_of_paper(40, paper="40", author="10 to 100", unit="epochs", smoke=2)
    batch_size: int = enhancer_of_paper(15, paper="15", author="2 to 20", unit="windows")
    learning_rate: float = setting(
        0.001,
        stages="enhancer",
        source=OURS,
        why="0.01 leaves errors of 0.24 and 1.00 after 40 epochs (seeds 0, 1), this 0.06 to 0.12",
        author="0.01, for 200 units",
    )
    loss: str = setting(
        "mean_squared_error",
        stages="enhancer",
        source=AUTHOR,
        why=MLP_CODE,
        author="mean squared error",
    )
    initialisers: str = setting(
        "by layer",
        stages="enhancer, noise GAN",
        source=AUTHOR,
        why=f"{GAN_CODE} and {MLP_CODE}",
        author="he_uniform in Dense 64 and Dense 25, else Keras' default, glorot_uniform",
        choices=("by layer", "he_uniform"),
    )

    # section 2.3: the noise and its GAN
    moving_average: int = setting(
        25,
        stages="noise",
        source=OURS,
        why="short beside 2 minutes; edges are cut",
        paper="pandas' rolling mean",
        unit="samples",
    )
    average: str = setting(
        "centred",
        stages="noise",
        source=OURS,
        why="a trailing one lags by 12 s and leaves 0.15 of the rotation's 0.25 in the noise",
        paper="pandas' rolling mean",
        choices=("centred", "trailing", "none"),
    )
    latent: int = gan_of_paper(16, paper="16", author="16", unit="elements")
    latent_scale: float = gan_of_author(
        4.0,
        author="4, 2 pi in the demo; the variable also holds the range of a function",
    )
    generator_units: int = gan_of_paper(64, paper="64", author="64", unit="units")
    generator_activation: str = gan_of_author("tanh", author="tanh")
    filters: int = setting(
        500,
        stages="noise GAN",
        source=AUTHOR,
        why=f"{GAN_CODE}; the 4 rows may be a slip for the stride, or 4 filters",
        paper='"merges input from 4 rows"',
        author="the window's length",
        unit="filters",
    )
    filter_width: int = gan_of_paper(
        20, paper='"a window 20 neurons wide"', author="20", unit="samples"
    )
    stride: int = gan_of_paper(4, paper='"a stride of 4 neurons"', author="4", unit="samples")
    narrow_units: int = gan_of_author(
        25, paper='"progressively narrowed"', author="25, or half the window", unit="units"
    )
    dropout: float = gan_of_author(
        0.3, author="0.3 after the convolution and after the narrow layer"
    )
    rows: int = gan_of_paper(
        200, paper='"the entire batch (200 rows)"', author="one number for all", unit="rows"
    )
    update: str = gan_of_paper(
        "mixed 100 + 100",
        paper='"trains on the entire batch (200 rows) of real and generated data"',
        author="two updates, real then generated",
        choices=("mixed 100 + 100", "mixed 200 + 200", "two of 200"),
    )
    gan_learning_rate: float = gan_of_author(0.001, paper="Adam", author="Adam, 0.001")
    iterations: int = gan_of_paper(
        1_000, paper="around 1,000", author="1,000; 5,000 in the demos", unit="iterations", smoke=20
    )
    record_every: int = gan_of_paper(
        100, paper="100-step intervals", author="100", unit="iterations", smoke=5
    )
    rounds: int = setting(
        2,
        stages="noise GAN",
        source=OURS,
        why="C4 follows training beyond the paper's number; all else uses the networks at it",
    )

    # how claims are measured
    detector_windows: int = of_claims(
        1_000, why="to train a detector; as many set its threshold", unit="windows", smoke=60
    )
    false_alarm_rate: float = of_claims(
        0.01, why="of each threshold, on windows of the detector's own kind of training data"
    )
    num_components: int = of_claims(
        20, why="of the PCA residual; the waves take up to four", unit="components"
    )
    num_trees: int = of_claims(200, why="of the isolation forest", unit="trees")
    autoencoder_epochs: int = of_claims(
        30, why="of the dense autoencoder, 128-16-128", unit="epochs", smoke=2
    )
    severity: float = of_claims(0.5, why="the middle of the range, in each degraded mode")
    speed_windows: int = of_claims(
        2_048, why="generated at a time when C2 is timed", unit="windows", smoke=256
    )

    fast: bool = setting(
        True,
        stages="enhancer, noise GAN",
        source=OURS,
        why="faster steps, equal up to rounding but for the masks of dropout",
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
        """Number of real rows, and of generated rows, from which the discriminator learns in one
        iteration.
        """
        return self.rows // 2 if self.update == "mixed 100 + 100" else self.rows


def make_settings(budget: str = "full", **changed: Any) -> Settings:
    """The settings at a budget, with some of them changed.

    Args:
        budget: `full`, or `smoke` for smaller counts.
        **changed: Values by name, for example `dropout=0`. Text is converted to the type of the
          setting.

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
    every = settings.record_every
    needs = {
        "window of at least filter_width": settings.window >= settings.filter_width,
        "iterations in two or more multiples of record_every": settings.iterations >= 2 * every
        and not settings.iterations % every,
        "rows of 2 or more": settings.rows > 1,
        "dropout and false_alarm_rate below 1": settings.dropout < 1 > settings.false_alarm_rate,
        "an odd moving_average, as it is centred": settings.average != "centred"
        or settings.moving_average % 2,
        "interval and periods above 0": settings.interval
        * settings.orbit_period
        * settings.rotation_period,
    }
    for words, holds in needs.items():
        if not holds:
            raise InputError(f"Expected {words}. Received: {changed}. Change one of them.")
    return settings


def _converted(field: dataclasses.Field, value: Any) -> Any:
    kind = type(field.default)
    choices = field.metadata["choices"]
    least = 1 if kind is int and field.name not in ("seed", "num_hidden") else 0
    end = 2**32 if field.name == "seed" else 1e12
    try:
        converted = YES_NO[value] if kind is bool else kind(value)
        is_choice = not choices or converted in choices
        is_in_range = kind not in (int, float) or least <= converted < end
    except (KeyError, TypeError, ValueError, OverflowError):
        is_choice = is_in_range = False
    if is_choice and is_in_range and (kind is not int or float(value) == converted):
        return converted
    expected = " or ".join(choices) or {
        bool: "yes or no",
        int: f"a whole number from {least} to below {end:g}",
        float: "a number from 0",
    }.get(kind, "a word")
    raise InputError(f"Expected {field.name} to be {expected}. Received: {value!r}.")
