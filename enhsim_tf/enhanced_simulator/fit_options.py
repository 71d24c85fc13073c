"""How a simulator is fitted to a channel: every choice, checked before anything slow is imported."""

import dataclasses

from enhsim_tf.common.errors import InputError

FEWEST_SAMPLES = 32  # of a window that is asked for: the discriminator's filters are 20 wide


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """How a simulator is fitted to a channel.

    Args:
        window: Samples of a window. None: two periods, from 64 to 500 samples.
        num_windows: Training windows, cut at random places.
        epochs: Passes of the enhancer over them, at a learning rate that falls to zero.
        num_iterations: Adversarial iterations of the noise.
        noise: `convolutional`, or the networks of the `paper`.
        held_out: Share of the telemetry, its end, that is kept for the report; 0 learns from all and reports on the same.
        seed: Seed of everything drawn.
    """

    window: int | None = None
    num_windows: int = 2_500
    epochs: int = 6
    num_iterations: int = 1_000
    noise: str = "convolutional"
    held_out: float = 0.2
    seed: int = 0

    def __post_init__(self):
        if not 0 <= self.held_out <= 0.5:
            raise InputError(f"Expected held_out from 0 to 0.5. Received: held_out={self.held_out}.")
        if self.window is not None and self.window < FEWEST_SAMPLES:
            raise InputError(f"Expected a window of at least {FEWEST_SAMPLES} samples. Received: window={self.window}.")
        for name, least in (("num_windows", 1), ("epochs", 1), ("num_iterations", 0)):
            if getattr(self, name) < least:
                raise InputError(f"Expected {name} of at least {least}. Received: {name}={getattr(self, name)}.")
