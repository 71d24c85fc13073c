"""Options of a fit. Nothing slow is imported."""

import dataclasses

from enhsim_tf.common.options import check_options, option
from enhsim_tf.enhancer.names import BEST, CANDIDATES
from enhsim_tf.noise.registry import NOISES

FEWEST_SAMPLES = 32  # minimum window length on request
# limits of the default window length in samples; the paper uses 500
LEAST_WINDOW = 64
MOST_WINDOW = 500
LEAST_LEARNT = 8  # minimum length of the training telemetry, in windows
_WINDOWS_IN_RECORD = 20  # without a period, the default window is this share of the record


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """Options of a fit, as those of the command `fit`: each field says what it is. Raises
    InputError if a value is out of range.
    """

    window: int | None = option(
        None,
        "window length in samples (default: two periods of a square wave, otherwise a twentieth of "
        "the record; limited to 64 to 500 and to an "
        "eighth of the record)",
        least=FEWEST_SAMPLES,
    )
    num_windows: int = option(
        1_000, "largest number of training windows; fewer of many channels", least=1
    )
    epochs: int = option(6, "training epochs of a network", least=1)
    noise: str | None = option(
        None,
        "noise model (default: matched-residual-windows; with --coarse, whose signal seldom "
        "repeats, residual-windows)",
        choices=NOISES,
    )
    enhancer: str = option(
        BEST,
        "enhancer; best is the simplest whose error on held-out time is not measurably larger than "
        "that of the best one, network is the paper's",
        choices=(BEST, *CANDIDATES),
    )
    held_out: float = option(
        0.2,
        "share of the telemetry, from its end, held out for the report; 0 reports on all of it",
        kind=float,
        least=0,
        most=0.5,
        metavar="SHARE",
    )
    delay_s: float | None = option(
        None,
        "delay of the telemetry relative to the recorded run, in seconds, or in samples if there "
        "are no times (default: estimated)",
        kind=float,
        metavar="SECONDS",
    )
    seed: int = option(0, "random seed", least=0, most=2**31 - 1)

    def __post_init__(self):
        check_options(self)


def default_window(num_samples: float) -> int:
    """Returns the window length in samples for a record of so many samples without a period that is
    known.
    """
    return int(min(max(num_samples // _WINDOWS_IN_RECORD, LEAST_WINDOW), MOST_WINDOW))
