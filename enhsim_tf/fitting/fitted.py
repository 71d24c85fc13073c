"""What a fit has learnt, whichever the coarse simulator is, and the simulator made of it."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse.alignment import Paired
from enhsim_tf.coarse.runs import Runs
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.enhancer.candidates import Choice
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.noise.registry import NoiseModel
from enhsim_tf.scoring.scorer import bounded
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.quantisation import Levels

# of all training windows, which bounds time and memory of a fit of many channels
_MOST_VALUES = 1_500_000
_LEAST_WINDOWS = 300  # training windows, however many channels


@dataclasses.dataclass(frozen=True, eq=False)
class Fitted:
    """Coarse simulator, alignment and enhancer, fitted to the beginning of the telemetry."""

    alignment: Waves | Runs
    choice: Choice  # of the enhancer
    # windows of noise and the enhanced signal below them, `(windows, samples, channels)`
    noise: np.ndarray
    clean: np.ndarray
    noise_name: str  # the noise model, unless the options name one
    nominal: Paired  # all the telemetry
    learnt: Paired  # its beginning
    held_out: Paired | None  # its end; None if nothing is held out
    # what is judged of the beginning and of all of it, each of shape `(samples, channels)`;
    # differences from enhanced runs are of enhancers that have not learnt them
    learnt_series: Sequence[np.ndarray]
    nominal_series: Sequence[np.ndarray]
    options: FitOptions
    coarse: str  # which coarse simulator was used and why
    notes: list[str]  # what else is to be said

    def simulator(
        self, noise: NoiseModel, run: Paired, trained: Mapping[str, Any]
    ) -> EnhancedSimulator:
        """Makes a simulator with the nominal run of this telemetry."""
        telemetry = self.learnt.telemetry
        return EnhancedSimulator(
            self.alignment.with_nominal(run),
            self.choice.enhancer,
            noise,
            telemetry.columns,
            telemetry.interval_s,
            tuple(map(Levels.find, telemetry.values.T)),
            bounded(self.nominal_series),
            trained,
        )


def num_training_windows(options: FitOptions, window: int, channels: int) -> int:
    """Returns the number of training windows, which is less than asked for if there are many
    channels.
    """
    return min(options.num_windows, max(_LEAST_WINDOWS, _MOST_VALUES // (window * channels)))
