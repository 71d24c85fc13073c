"""Options of fitting, scoring and updating, declared once: in Python as fields, on the command line as options. Nothing slow is imported."""

import argparse
import dataclasses
from typing import Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS, RESIDUAL, option_name
from enhsim_tf.enhancer.names import BEST, CANDIDATES
from enhsim_tf.noise.names import NOISES

FEWEST_SAMPLES = 32  # minimum window length on request
LEAST_WINDOW, MOST_WINDOW = (
    64,
    500,
)  # limits of the default window length in samples; the paper uses 500
LEAST_LEARNT = 8  # minimum length of the training telemetry, in windows
_WINDOWS_IN_RECORD = 20  # without a period, the default window is this share of the record


def _option(default: Any, help_text: str, **limits: Any):  # noqa: ANN202
    known = {
        "help": help_text,
        "least": None,
        "most": None,
        "choices": (),
        "kind": int,
        "option": None,
    }
    return dataclasses.field(default=default, metadata=known | limits)


def option_of(name: str) -> str:
    """The option of the commands for a field, for example `--held-out` for `held_out`."""
    return "--" + name.removesuffix("_s").replace("_", "-")


def _check(field: dataclasses.Field, value: Any) -> None:
    limits = field.metadata
    if value is None and field.default is None:
        return
    if limits["choices"]:
        if value not in limits["choices"]:
            raise InputError(
                f"Expected {field.name}, one of: {', '.join(limits['choices'])}. Received: {field.name}={value!r}."
            )
        return
    is_number = isinstance(
        value, int if limits["kind"] is int else (int, float)
    ) and not isinstance(value, bool)
    low, high = limits["least"], limits["most"]
    if (
        not is_number
        or (low is not None and not value >= low)
        or (high is not None and not value <= high)
    ):
        what = "a whole number" if limits["kind"] is int else "a number"
        span = (
            ""
            if low is None
            else f" of at least {low:g}"
            if high is None
            else f" from {low:g} to {high:g}"
        )
        raise InputError(
            f"Expected {field.name} ({limits['option'] or option_of(field.name)}) to be {what}{span}. Received: {value!r}. Choose another."
        )


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """Options of a fit, as those of the command `fit`: each field says what it is. Raises InputError if a value is out of range."""

    window: int | None = _option(
        None,
        "window length in samples (default: two periods of a square wave, otherwise a twentieth of the record; limited to 64 to 500 and to an "
        "eighth of the record)",
        least=FEWEST_SAMPLES,
    )
    num_windows: int = _option(
        1_000, "number of training windows (default: 1000; fewer for many channels)", least=1
    )
    epochs: int = _option(6, "training epochs of a network (default: 6)", least=1)
    noise: str | None = _option(
        None,
        "noise model (default: matched-residual-windows; with --coarse, whose signal seldom repeats, residual-windows)",
        choices=NOISES,
    )
    enhancer: str = _option(
        BEST,
        "enhancer (default: best, the simplest whose error on held-out time is not measurably larger than that of the best one); network is the "
        "paper's",
        choices=(BEST, *CANDIDATES),
    )
    held_out: float = _option(
        0.2,
        "share of the telemetry, from its end, held out for the report; 0 reports on all of it (default: 0.2)",
        least=0,
        most=0.5,
        kind=float,
    )
    delay_s: float | None = _option(
        None,
        "delay of the telemetry relative to the recorded run, in seconds, or in samples if there are no times (default: estimated)",
        kind=float,
    )
    seed: int = _option(0, "random seed (default: 0)", least=0, most=2**31 - 1)

    def __post_init__(self):
        for field in dataclasses.fields(self):
            _check(field, getattr(self, field.name))


@dataclasses.dataclass(frozen=True)
class ScoreOptions:
    """Options of scoring, as those of the command `score`. Raises InputError if the detector is unknown or a number is out of range."""

    detector: str | None = None  # the one that the fit chose by held-out time
    num_windows: int = _option(
        2_000,
        "generated windows from which the detector learns (default: 2000)",
        least=10,
        option="--windows",
    )
    false_alarm_rate: float = _option(
        0.01, "share of nominal samples to flag (default: 0.01)", least=1e-9, most=0.5, kind=float
    )
    seed: int = _option(0, "random seed (default: 0)", least=0, most=2**31 - 1)

    def __post_init__(self):
        known = (RESIDUAL, *DETECTORS)
        if self.detector is not None and self.detector not in known:
            raise InputError(
                f"Expected a detector, one of: {', '.join(known)}. Received: {self.detector!r}."
            )
        for field in dataclasses.fields(self)[1:]:
            _check(field, getattr(self, field.name))


def add_options(parser: argparse.ArgumentParser, options: type, *names: str) -> None:
    """Adds fields of a class of options, given by name, to a parser or a group of it."""
    fields = {field.name: field for field in dataclasses.fields(options)}
    for name in names:
        default, about = fields[name].default, fields[name].metadata
        if about["choices"]:
            given = {
                "choices": tuple(map(option_name, about["choices"])),
                "default": default and option_name(default),
            }
        else:
            metavar = {"held_out": "SHARE", "false_alarm_rate": "SHARE", "delay_s": "SECONDS"}.get(
                name, "N"
            )
            given = {"type": about["kind"], "default": default, "metavar": metavar}
        parser.add_argument(option_of(name), dest=name, help=about["help"], **given)


def options_from(namespace: argparse.Namespace, options: type) -> Any:
    """Makes an object of a class of options from a parsed command line; raises InputError if a value is out of range."""
    found = {}
    for field in dataclasses.fields(options):
        value, spelled = (
            getattr(namespace, field.name),
            {option_name(each): each for each in field.metadata["choices"]},
        )
        found[field.name] = spelled.get(value, value)
    return options(**found)


def default_window(num_samples: float) -> int:
    """Returns the window length in samples for a record of so many samples without a period that is known."""
    return int(min(max(num_samples // _WINDOWS_IN_RECORD, LEAST_WINDOW), MOST_WINDOW))
