"""Settings for updating a simulator. They are validated before any slow import."""

import dataclasses

from enhsim_tf.common.errors import InputError


@dataclasses.dataclass(frozen=True)
class UpdateOptions:
    """Settings of an update.

    Args:
        epochs: Passes of the enhancer over windows of the new telemetry; 0 keeps its weights.
        num_windows: Number of these windows.
        held_out: Share of the new telemetry, at its end, on which the update is judged; above 0.
        seed: Random seed.

    Raises:
        InputError: If a value is out of range.
    """

    epochs: int = 2
    num_windows: int = 1_000
    held_out: float = 0.2
    seed: int = 0

    def __post_init__(self):
        if self.epochs < 0 or self.num_windows < 10 or not 0 < self.held_out <= 0.5:
            raise InputError(f"Expected epochs >= 0, num_windows >= 10 and 0 < held_out <= 0.5. Received: {self}.")
