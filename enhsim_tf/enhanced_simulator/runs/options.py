"""Settings for fitting a run model. They are validated before any slow import."""

import dataclasses

from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.fit_options import FEWEST_SAMPLES, NOISES
from enhsim_tf.noise.names import BEST

RUNGS = ("coarse", "level and gain", "ridge", "ridge and network", "network")  # as in `enhancer.ladder`, which imports TensorFlow


@dataclasses.dataclass(frozen=True)
class RunOptions:
    """Settings for fitting a run model.

    Args:
        window: Length of a window in samples. None: a twentieth of the training telemetry, from 64 to 500 samples.
        num_windows: Number of training windows, evenly spaced over the time.
        epochs: Passes of the networks over the training windows.
        noise: Model of the noise, as in `FitOptions`.
        enhancer: One of `RUNGS`, or None, which chooses the simplest rung that is not measurably worse than the best one.
        delay_s: How much later the telemetry is than the coarse run, in seconds. None: it is estimated.
        held_out: Share of the telemetry, taken from its end, that is reserved for the report.
        seed: Random seed of training and report.

    Raises:
        InputError: If a value is out of range.
    """

    window: int | None = None
    num_windows: int = 2_500
    epochs: int = 6
    noise: str = BEST
    enhancer: str | None = None
    delay_s: float | None = None
    held_out: float = 0.2
    seed: int = 0

    def __post_init__(self):
        if not 0 <= self.held_out <= 0.5:
            raise InputError(f"Expected held_out from 0 to 0.5. Received: held_out={self.held_out}.")
        if self.window is not None and self.window < FEWEST_SAMPLES:
            raise InputError(f"Expected a window of at least {FEWEST_SAMPLES} samples. Received: window={self.window}.")
        for name, least in (("num_windows", 10), ("epochs", 1)):
            if getattr(self, name) < least:
                raise InputError(f"Expected {name} to be at least {least}. Received: {name}={getattr(self, name)}.")
        if self.noise not in NOISES or self.enhancer not in (None, *RUNGS):
            raise InputError(
                f"Expected noise among {', '.join(NOISES)}, enhancer among {', '.join(RUNGS)}. Received: {self.noise!r}, {self.enhancer!r}."
            )
        if self.delay_s is not None and not abs(self.delay_s) < 1e12:
            raise InputError(f"Expected a delay in seconds. Received: delay_s={self.delay_s}.")
