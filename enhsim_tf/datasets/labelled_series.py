"""One continuous labelled series, with labels that mark exactly the samples that a scenario has
changed.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.datasets.label_columns import series_table
from enhsim_tf.datasets.places import ScenarioRange, draw_between, parse_start
from enhsim_tf.simulator.changes import fade_length
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.placing import PlacedEvent, in_order, place_events
from enhsim_tf.telemetry.series import DATES, Clock


def series_index(num_samples: int, interval_s: float, start: str | pd.Timestamp | None) -> pd.Index:
    """Returns the index of a generated series: times in UTC named `time`, or, without a start,
    seconds from 0 named `time_s`.
    """
    seconds = np.arange(num_samples) * interval_s
    if start is None:
        return pd.Index(np.round(seconds, 9), name="time_s")
    return Clock(interval_s, parse_start(start).value, DATES).index(seconds)


def series_labelled(
    simulator: EnhancedSimulator,
    num_samples: int,
    scenario: Degraded | None = None,
    seed: int = 0,
    start: str | pd.Timestamp | None = None,
    schedule: Sequence[PlacedEvent] = (),
) -> pd.DataFrame:
    """Generates one continuous series with labels. Samples that equal those of the nominal series
    are labelled nominal.

    Args:
        simulator: The simulator.
        num_samples: Length of the series in samples.
        scenario: A degraded mode over the whole series, or None for nominal telemetry.
        seed: Random seed.
        start: Time of the first sample, for example "2024-01-01". A time without a time zone is
            taken as UTC. None gives times in seconds from 0.
        schedule: Degraded modes at given places, each followed by nominal operation, instead of a
            scenario.

    Returns:
        A data frame with one row per sample and the columns `value` (of several channels, their
        names, and `mask NAME` for each) and `label_columns.LABELS`; `scenario` is categorical. Its
        index is a `DatetimeIndex` in UTC named `time`, or, without a start, seconds named `time_s`.

    Raises:
        InputError: If the start is not a time, if events overlap or lie outside the series, or if
            both a scenario and a schedule are given.
    """
    index = series_index(num_samples, simulator.interval_s, start)
    values, masks, events = simulator.generate_labelled_series(
        num_samples, scenario, seed, schedule=schedule
    )
    return series_table(values, masks, simulator.channels, events, index)


def draw_schedule(
    simulator: EnhancedSimulator,
    num_samples: int,
    given: Sequence[PlacedEvent],
    modes: Sequence[ScenarioRange],
    number: int,
    lengths: tuple[int, int],
    rng: np.random.Generator,
) -> list[PlacedEvent]:
    """Adds events at drawn places to those at given places, in the order of time, in a series that
    begins at time 0.

    The modes are used in turn; each event draws its severity, and its length in samples between the
    two `lengths`. Events are at least the greatest length apart. They are placed by
    `placing.place_events`: `stuck`, for example, changes nothing while the mechanism stands still.
    """
    simulator.alignment.check([*modes, *given])
    given = in_order(given, [(0, num_samples)], gap=1)
    gap = max(2 * fade_length(simulator.window) + 1, lengths[1])  # changes that fade do not meet
    turns = [
        (modes[turn % len(modes)], int(rng.integers(lengths[0], lengths[1] + 1)))
        for turn in range(number)
    ]
    drawn = [(mode.mode, draw_between(mode.severity, rng), length) for mode, length in turns]

    def changes(event: PlacedEvent) -> bool:
        mode = Degraded(event.kind, event.severity, 0.0, event.channel)
        return simulator.alignment.changes(mode, event.begin, event.end)

    return place_events(given, drawn, [(0, num_samples)], gap, changes, rng)
