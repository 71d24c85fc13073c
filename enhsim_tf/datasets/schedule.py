"""Schedules of degraded modes in a generated series: events at given and random places, each followed by nominal operation."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded, ScheduledMode, check_schedule
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.anomalies import TRIES, draw_begin
from enhsim_tf.simulator.changes import fade_length

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator


def draw_schedule(
    simulator: "EnhancedSimulator",
    num_samples: int,
    given: Sequence[ScheduledMode],
    modes: Sequence[Degraded],
    number: int,
    lengths: tuple[int, int],
    gap: int | None,
    rng: np.random.Generator,
) -> list[ScheduledMode]:
    """Adds events at drawn places to those at given places.

    The modes are used in turn. The longest events are placed first, each uniformly among all places that are free. A place where
    the mode would not change the coarse run is drawn again: for example, `stuck` changes nothing while the mechanism stands still.

    Args:
        simulator: The simulator, whose series begins at time 0.
        num_samples: Length of the series.
        given: Events at given places.
        modes: Modes and severities of the drawn events; their onset is not used.
        number: Number of events at drawn places.
        lengths: Least and greatest length of a drawn event in samples.
        gap: Least number of nominal samples between a drawn event and any other. None: the greatest length. It is at least twice
            the fade of a change.
        rng: Random number generator.

    Returns:
        The events in the order of time.

    Raises:
        InputError: If events overlap or do not fit, or if a mode changes nothing at any of the drawn places.
    """
    if simulator.is_run_model:
        simulator.alignment.draw(np.zeros(0, int), [*modes, *given], rng)  # refuses them
    schedule = check_schedule(given, num_samples)
    gap = max(2 * fade_length(simulator.window) + 1, lengths[1] if gap is None else gap)
    drawn = [(modes[each % len(modes)], int(rng.integers(lengths[0], lengths[1] + 1))) for each in range(number)]
    for mode, length in sorted(drawn, key=lambda each: -each[1]):
        taken = [(event.begin, event.end) for event in schedule]
        for _ in range(TRIES):
            event = ScheduledMode(mode.mode, mode.severity, draw_begin([(0, num_samples)], taken, length, gap, rng), length)
            times = simulator.interval_s * np.arange(event.begin, event.end)[None]
            scenario = Degraded(mode.mode, mode.severity, 0.0)
            waves = simulator.alignment.simulators
            if any((each.simulate(times, scenario, np.random.default_rng(0)) != each.simulate(times)).any() for each in waves):
                break
        else:
            raise InputError(
                f"Expected a place where the mode changes the coarse run. Received: {mode.mode} at {mode.severity:g} over {length} samples, "
                f"which changes nothing at {TRIES} drawn places. Give it a higher severity or a greater length."
            )
        schedule.append(event)
    return sorted(schedule, key=lambda event: event.begin)
