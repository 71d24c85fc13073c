"""Settings for fitting a simulator to a channel. They are validated before any slow import."""

import dataclasses

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.names import BEST, CANDIDATES

ENHANCERS = ("coarse", "ridge", "ridge and network", "network")  # rungs of `enhancer.ladder` for windows at their own level and gain
NOISES = (BEST, *CANDIDATES)
FEWEST_SAMPLES = 32  # minimum window length on request
LEAST_WINDOW, MOST_WINDOW = 64, 500  # limits of the default window length in samples; the paper uses 500
LEAST_LEARNT = 8  # minimum length of the training telemetry, in windows
_WINDOWS_IN_RECORD = 20  # without a period, the default window is this share of the record


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """Settings for fitting a simulator to a channel. The defaults are those of the command `fit`.

    Args:
        window: Length of a window in samples. None uses two periods of a square wave and otherwise a twentieth of the record, limited to 64
            to 500 samples, or fewer if eight windows would not fit into the record.
        num_windows: Number of training windows, cut at random starts.
        epochs: Passes of the enhancer over the training windows, with a learning rate that falls to zero.
        noise: Model of the noise: one of `NOISES`, or `best`, the simplest that held-out telemetry does not tell from real noise
            (see `noise_choice`).
        held_out: Share of the telemetry, taken from its end, that is reserved for the report. 0 trains and reports on all
            telemetry.
        seed: Random seed of training and report.
        enhancer: `network`, the paper's; `best`, the simplest rung of `enhancer.ladder` that is not measurably worse than the
            best one on held-out time; or one of `ENHANCERS`.

    Raises:
        InputError: If a value is out of range.
    """

    window: int | None = None
    num_windows: int = 2_500
    epochs: int = 6
    noise: str = BEST
    held_out: float = 0.2
    seed: int = 0
    enhancer: str = BEST

    def __post_init__(self):
        if not 0 <= self.held_out <= 0.5:
            raise InputError(f"Expected held_out from 0 to 0.5. Received: held_out={self.held_out}.")
        if self.enhancer not in (*ENHANCERS, BEST):
            raise InputError(f"Expected enhancer, one of: best, {', '.join(ENHANCERS)}. Received: enhancer={self.enhancer!r}.")
        if self.noise not in NOISES:
            raise InputError(f"Expected noise, one of: {', '.join(NOISES)}. Received: noise={self.noise!r}.")
        if self.window is not None and self.window < FEWEST_SAMPLES:
            raise InputError(f"Expected a window of at least {FEWEST_SAMPLES} samples. Received: window={self.window}.")
        for name, least in (("num_windows", 1), ("epochs", 1)):
            if getattr(self, name) < least:
                raise InputError(f"Expected {name} to be at least {least}. Received: {name}={getattr(self, name)}.")


def default_window(num_samples: float) -> int:
    """Returns the window length in samples for a record without a period that is known.

    Args:
        num_samples: Length of the record in samples.
    """
    return int(min(max(num_samples // _WINDOWS_IN_RECORD, LEAST_WINDOW), MOST_WINDOW))
