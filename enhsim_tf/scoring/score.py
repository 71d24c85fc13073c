"""Scores telemetry with the views that a simulator's nominal telemetry has taught.

Views judge telemetry, or with a recorded run the telemetry minus the enhanced run.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from enhsim_tf.common.atomic_files import replace_files
from enhsim_tf.common.columns import apart_from
from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.scoring.events import (
    LEARNT,
    MEMORY,
    Event,
    confidence_of,
    false_alarms_per_day,
    flags_of,
    onset_of,
    spans_of,
)
from enhsim_tf.scoring.options import ScoreOptions
from enhsim_tf.scoring.scorer import Scorer, Scores
from enhsim_tf.scoring.trusted_range import TrustedRange
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Clock, Telemetry, check_telemetry

_OURS = "time", "sample", "score", "flag", "out_of_range"
_LEAST_SHARE = 0.3  # of the channel that has raised most of an event; others have raised it, too


@dataclasses.dataclass(frozen=True, eq=False)
class ScoredTelemetry:
    """What `score` returns.

    Args:
        table: One row per sample, with the index of `Telemetry.index` and the columns `value` (of a
            simulator of several channels, their names), with a run `enhanced` (of several channels,
            `enhanced NAME`), `score` (the threshold is 1), `flag` (see `events.flags_of`), and with
            a run `out_of_range` (above 1, the coarse run is outside the training range). Samples in
            parts shorter than a window, or without a run, have NaN in place of scores.
        columns: The column of each channel.
        events: The alarms, in the order of time.
        window: Length of the windows of the views in samples.
        clock: The clock of the telemetry.
        false_alarm_rate: Share of nominal samples that the threshold is set to flag.
        false_alarms_per_day: Expected number on the nominal telemetry, and the limits of its 95 %
            interval.
        not_judged: Names of channels of the simulator that the telemetry does not have.
        enhanced: With a run, the column of the enhanced signal of each channel.
    """

    table: pd.DataFrame
    columns: Mapping[str, str]
    events: tuple[Event, ...]
    window: int
    clock: Clock
    false_alarm_rate: float = 0.01
    false_alarms_per_day: tuple[float, float, float] = (0.0, 0.0, 0.0)
    not_judged: tuple[str, ...] = ()
    enhanced: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def departure(self) -> str:
        """A sentence if the last event lasts until the end of what was scored, or an empty text."""
        last = np.flatnonzero(self.table["score"].notna())[-1] + 1
        lasting = [
            event
            for event in self.events
            if event.against == LEARNT
            and event.end >= last
            and event.end - event.begin > MEMORY * self.window
        ]
        if not lasting:
            return ""
        when = told_times(self.table.index[[lasting[-1].begin]], self.clock)[0]
        if not hasattr(when, "tz"):
            when = f"{when:.10g} s" if self.clock.counts else f"sample {when:,}"
        return (
            f"1 lasting departure since {when}: the telemetry has left what was learnt and stays "
            f"there ({', '.join(lasting[-1].views)}). It is a lasting fault, or the new normal: "
            "then go on with `update`. What goes further is an event of its own"
        )


def scorer_of(
    simulator: EnhancedSimulator,
    options: ScoreOptions | None = None,
    channels: Sequence[str] | None = None,
) -> Scorer:
    """Makes the scorer of a fitted simulator, from its nominal telemetry.

    Args:
        simulator: The simulator.
        options: Options of the scoring. None uses the defaults.
        channels: Names of the channels to judge. None: all.

    Raises:
        InputError: If the simulator was not fitted.
    """
    if not simulator.nominal:
        raise InputError(
            "Expected a simulator with nominal telemetry to learn from. Received: one without. "
            "Make it with `fit`."
        )
    places = [simulator.channels.index(name) for name in channels or simulator.channels]
    options = options or ScoreOptions()
    return Scorer([series[:, places] for series in simulator.nominal], options.false_alarm_rate)


@threadpool_limits.wrap(limits=1)  # several threads take longer for arrays of this size
def score(
    simulator: EnhancedSimulator,
    telemetry: Telemetry,
    run: Telemetry | None = None,
    options: ScoreOptions | None = None,
) -> ScoredTelemetry:
    """Scores every sample of telemetry.

    Args:
        simulator: The fitted simulator.
        telemetry: Telemetry of its channels, or of some of them, as returned by
            `join_channels`.
        run: The coarse run of the same time, for a simulator of recorded runs.
        options: Options of the scoring. None uses the defaults.

    Raises:
        InputError: If channels, interval or run do not fit to the simulator, or if every part is
            shorter than a window.
    """
    check_telemetry(telemetry)
    if not all(np.isfinite(part.values).all() for part in telemetry.parts):
        raise InputError(
            f"Expected finite values. Received: {telemetry.name} with NaN or infinite ones. Fill "
            "them, or cut the telemetry there: `read_telemetry` does both."
        )
    paired = simulator.pair(telemetry, run)
    channels = paired.telemetry.columns
    scorer = scorer_of(simulator, options, channels)
    values = telemetry.values
    scores = np.full(len(values), np.nan)
    flags = np.zeros(len(values), bool)
    enhanced = np.full(values.shape, np.nan, np.float32)
    explained = simulator.explained_series(paired)
    places = paired.places_in(telemetry)
    events: list[Event] = []
    for place, part, known in zip(places, paired.telemetry.parts, explained, strict=True):
        if len(part) >= scorer.window:
            here = slice(place, place + len(part))
            seen = part.values - known
            judged = scorer.score(seen)
            scores[here] = judged.samples
            flags[here] = flags_of(judged.samples, scorer.window)
            enhanced[here] = known
            events += _events(scorer, seen, judged, flags[here], place, channels)
    if np.isnan(scores).all():
        raise InputError(
            f"Expected a part of at least one window of {scorer.window} samples. Received: "
            f"{counted(max(map(len, telemetry.parts)), 'sample')}. Give more telemetry."
        )
    if len(simulator.channels) == 1:
        of_run = {channels[0]: "enhanced"}
        names = {channels[0]: "value"}
    else:
        of_run = {name: f"enhanced {name}" for name in channels}
        names = apart_from((*_OURS, *of_run.values()), channels)
    columns = dict(zip(names.values(), values.T, strict=True))
    results = {"score": scores, "flag": flags}
    if paired.run is not None:
        columns |= dict(zip(of_run.values(), enhanced.T, strict=True))
        outside = np.full(len(values), np.nan)
        trusted = TrustedRange(simulator)
        for place, coarse in zip(places, paired.run.parts, strict=True):
            outside[place : place + len(coarse)] = trusted.score_run(coarse.values)
        results["out_of_range"] = outside
    frame = pd.DataFrame(columns | results, index=telemetry.index)
    window = scorer.window
    num_nominal = sum(
        len(spans_of(part, flags_of(part, window), window))
        for part in np.split(scorer.nominal_scores, scorer.nominal_edges[1:-1])
    )
    seconds = len(scorer.nominal_scores) * simulator.interval_s
    return ScoredTelemetry(
        frame,
        names,
        tuple(events),
        window,
        telemetry.clock,
        scorer.rate,
        false_alarms_per_day(num_nominal, seconds),
        tuple(name for name in simulator.channels if name not in channels),
        of_run if paired.run is not None else {},
    )


def _events(
    scorer: Scorer,
    seen: np.ndarray,
    scores: Scores,
    flags: np.ndarray,
    place: int,
    channels: Sequence[str],
) -> list[Event]:
    """The events of a stretch without gaps, whose first sample is that of this place, with the
    onset, the views and the channels of each.
    """
    window = scorer.window
    events = []
    for flagged, end, against in spans_of(scores.samples, flags, window):
        # the first samples have the score of the first one that is known from all its windows
        raised = max(flagged, window - 1)
        low = min(max(0, raised - 2 * window + 1), len(seen) - window)
        past = scorer.window_scores(seen[low : raised + window])
        is_under_way = flagged < window and past[0] > 1
        begin = flagged if is_under_way else low + onset_of(past, raised - low, window)
        stop = max(end, begin + 1)
        top = flagged + int(np.argmax(scores.samples[flagged:end]))
        # the windows that hold the first anomalous sample raise the scores of samples before it
        peak = begin + int(np.argmax(scores.samples[begin:stop]))
        onset = min(begin, len(seen) - window)
        last = min(len(seen), onset + MEMORY * window, max(end, onset + window))
        firsts = range(onset, last - window + 1, window)
        shares = sum(scorer.shares(seen[first : first + window]) for first in firsts)
        holds_top = (scores.begins <= top) & (scores.begins > top - window)
        by_view = max(scores.by_view.T[holds_top], key=np.sum)
        highest = float(scores.samples[top])
        events.append(
            Event(
                place + begin,
                place + stop,
                place + min(raised + window, len(seen)) - 1,
                place + peak,
                int(flags[flagged:end].sum()),
                highest,
                confidence_of(highest, scorer.nominal_scores, window),
                against,
                _largest(scorer.names, by_view, by_view >= min(1.0, by_view.max())),
                _largest(channels, shares, shares >= _LEAST_SHARE * shares.max()),
            )
        )
    return events


def _largest(names: Sequence[str], sizes: np.ndarray, marks: np.ndarray) -> tuple[str, ...]:
    """The marked names, the one with the largest size first."""
    return tuple(names[place] for place in np.argsort(-sizes, kind="stable") if marks[place])


def told_times(index: pd.Index, clock: Clock) -> pd.Index:
    """Returns times as they are written: of a clock that counts from zero in seconds."""
    if not clock.counts:
        return index
    return pd.Index((index - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1), name=index.name)


def events_table(scored: ScoredTelemetry) -> pd.DataFrame:
    """Returns the events of scored telemetry, one row per alarm.

    The columns are those of `events.Event`: `begin`, `end`, `detected` and `peak` are times, or
    sample numbers if the telemetry has no times; `duration_s` follows them; `views` and `channels`
    are in one text each, the largest first.
    """
    names = [field.name for field in dataclasses.fields(Event)]
    table = pd.DataFrame(list(scored.events), columns=names)
    index = scored.table.index
    places = table[["begin", "end", "detected", "peak"]].to_numpy(int)
    begin, end, detected, peak = places.T
    interval_s = scored.clock.interval_s
    step = pd.Timedelta(round(interval_s * 1e9), unit="ns") if hasattr(index, "tz") else 1
    times = {
        "begin": index[begin],
        "end": index[end - 1] + step,
        "detected": index[detected],
        "peak": index[peak],
    }
    told = {name: told_times(at, scored.clock) for name, at in times.items()}
    texts = {name: table[name].map(", ".join) for name in ("views", "channels")}
    table = table.assign(**told, **texts)
    table.insert(4, "duration_s", np.round((end - begin) * interval_s, 9))
    return table


def events_path(path: str | os.PathLike) -> Path:
    """Returns the path of the events beside a file of scores, for example `scores.events.csv`
    beside `scores.parquet`.
    """
    return Path(path).with_suffix(".events.csv")


def write_scores(path: str | os.PathLike, scored: ScoredTelemetry) -> None:
    """Writes scored telemetry to a `.parquet` or `.csv` file, and its events to `events_path`. Both
    files appear together, when they are complete.
    """
    plain = scored.table.set_axis(told_times(scored.table.index, scored.clock))
    with replace_files(path, events_path(path)) as (temporary, events):
        events_table(scored).to_csv(events, index=False)
        if Path(path).suffix.lower() == ".csv":
            plain.to_csv(temporary)
        else:
            # sample numbers, too, are a column for every reader
            plain.to_parquet(temporary, index=True)
