"""Scores telemetry with a detector that has learnt from generated nominal telemetry.

The threshold is the largest of three: that of generated telemetry, that of the nominal telemetry of the fit, and that of its end alone, which was
held out, since the residual is smaller where the enhancer has learnt. Generated telemetry never undercuts what real nominal time shows.
"""

import dataclasses
import functools
import itertools
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from enhsim_tf.coarse_simulator.recording import SAME_RATE, Recording, Run
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.detection import metrics
from enhsim_tf.detection.detectors import JointSize, following_drift, root_mean_square
from enhsim_tf.detection.events import Event, confidences, events_of, false_alarms_per_day
from enhsim_tf.detection.registry import DETECTORS, RESIDUAL
from enhsim_tf.enhancer.model import run_starts
from enhsim_tf.simulator.joint import cut, split_end, telemetry_of
from enhsim_tf.simulator.operating_point import Departure, find_departure
from enhsim_tf.simulator.options import ScoreOptions
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange
from enhsim_tf.telemetry.pandas_series import index_of
from enhsim_tf.telemetry.windows import mean_over_windows

_THRESHOLD_WINDOWS = 1_000  # length in windows of the generated series for the threshold; only scores a window apart are independent
_STRIDES = 8  # number of scored windows that begin within one window length
_SERIES_VALUES = 4_000_000  # most values of such a series
_CHUNK_VALUES = 4_000_000  # values of windows that are scored at a time
_NOMINAL_VALUES = 2_000_000  # most values of nominal telemetry with which a threshold is set
LEARNT, NEW = "learnt", "new operating point"
"""What an event departs from."""


class Scorer:
    """A detector of one simulator, with its threshold. Scores are divided by the threshold, so scores above 1 are anomalous.

    For square waves, `residual` and `innovation` judge telemetry minus the aligned simulator, the other detectors the telemetry itself. For
    recorded runs, all judge the telemetry minus the enhanced run of the same time. The size of a residual is its root mean square, of several
    channels the distance of `JointSize`.

    Args:
        simulator: The simulator, whose nominal telemetry bounds the threshold from below.
        options: Options of the scoring.
    """

    def __init__(self, simulator: EnhancedSimulator, options: ScoreOptions | None = None):
        self.simulator, self.options = simulator, options or ScoreOptions()
        self.window = simulator.window
        self.name = (
            self.options.detector
            or ScoreOptions(str(simulator.trained.get("detector", "PCA residual"))).detector
        )
        self.on_residual = simulator.is_run_model or self.name in (RESIDUAL, "innovation")
        self.unit = (
            np.ones(1)
            if len(simulator.channels) == 1
            else simulator.noise_sd
            if self.on_residual
            else simulator.scale
        )
        self.unit = np.where(self.unit > 0, self.unit, 1.0).astype(np.float32)
        # of the generated series, in windows
        self._length = int(
            np.clip(
                _SERIES_VALUES // (self.window * len(simulator.channels)), 100, _THRESHOLD_WINDOWS
            )
        )
        seed = self.options.seed
        training = simulator.generate(
            self.options.num_windows, seed=seed, with_noise=not simulator.is_run_model
        )
        if simulator.is_run_model:
            training = simulator.draw_noise(training, np.random.default_rng([seed, 3]))
        means = training.mean(axis=1, dtype=np.float64)
        width = np.maximum(np.ptp(means, axis=0), simulator.noise_sd)
        self._low, self._high = (
            means.min(axis=0) - width,
            means.max(axis=0) + width,
        )  # levels beyond count as residual
        if self.name == RESIDUAL:
            self._joint = (
                None if len(simulator.channels) == 1 else JointSize().fit(self._judged(training))
            )
            self.typical_size = float(np.median(self._sizes(training)))
        else:
            self.detector = DETECTORS[self.name](seed).fit(self._judged(training))
        generated, self.rate = metrics.finite_threshold(
            self._of_generated(seed + 1), self.options.false_alarm_rate, self._length
        )
        self.nominal_threshold = -np.inf
        for real in self._of_nominal():
            found, _ = metrics.finite_threshold(
                real, self.options.false_alarm_rate, len(real) // self.window
            )
            self.nominal_threshold = max(self.nominal_threshold, found)
        self.threshold = max(generated, self.nominal_threshold)

    @functools.cached_property
    def nominal_scores(self) -> np.ndarray:
        """Scores of a further generated series, on which alarms are counted."""
        return self._relative(self._of_generated(self.options.seed + 2))

    def _of_generated(self, seed: int) -> np.ndarray:
        series = self.simulator.generate_series(self._length * self.window, seed=seed)
        if self.simulator.is_run_model:
            series = series - self.simulator.nominal_series(len(series))
        return self._raw(series)

    def _of_nominal(self) -> list[np.ndarray]:
        """Scores the nominal telemetry of the fit, and its held-out end once more, as a series of its own."""
        nominal, run = self.simulator.nominal, self.simulator.nominal_run
        if nominal is None:
            return []
        held_out = 1 - self.simulator.trained.get("num_samples", len(nominal)) / len(nominal)
        found = [self._of_recording(nominal, run)]
        if held_out:
            found.append(
                self._of_recording(*(split_end(each, held_out)[1] for each in (nominal, run)))
            )
        return [scores for scores in found if len(scores)]

    def _of_recording(self, nominal: Recording, run: Recording | None) -> np.ndarray:
        """Scores nominal telemetry: of parts with too many values the end."""
        most = max(
            self.window, _NOMINAL_VALUES // (len(self.simulator.channels) * len(nominal.parts))
        )

        def end(recording: Recording) -> Recording:
            return dataclasses.replace(
                recording, parts=tuple(Run(part.values[-most:]) for part in recording.parts)
            )

        series = self.simulator.judged_series(end(nominal), None if run is None else end(run))
        return np.concatenate([np.zeros(0), *map(self._raw, series)])

    def _judged(self, windows: np.ndarray) -> np.ndarray:
        """What the detector sees of windows: one channel as it is, several in units of their standard deviations."""
        if self.on_residual and not self.simulator.is_run_model:
            windows = self.simulator.residuals(windows)
        return windows / self.unit

    def _raw(self, series: np.ndarray) -> np.ndarray:
        """Scores each sample of a series of shape `(samples, channels)`, without dividing by the threshold."""
        begins = run_starts(len(series), self.window, max(1, self.window // _STRIDES))
        step = max(1, _CHUNK_VALUES // (self.window * series.shape[1]))
        chunks = (begins[first : first + step] for first in range(0, len(begins), step))
        scores = np.concatenate(
            [self.score_windows(cut([series], chunk, self.window)) for chunk in chunks]
        )
        if (
            self.name == RESIDUAL
        ):  # its scale follows the windows before, so it sees all sizes at once
            scores = following_drift(scores, self.typical_size)
        return mean_over_windows(scores, begins, self.window, len(series))

    def _sizes(self, windows: np.ndarray) -> np.ndarray:
        judged = self._judged(windows)
        sizes = (
            root_mean_square(judged) if self._joint is None else np.sqrt(self._joint.score(judged))
        )
        if self.simulator.is_run_model:
            return sizes
        means = windows.mean(axis=1, dtype=np.float64)
        beyond = (means - np.clip(means, self._low, self._high)) / self.unit
        return np.hypot(sizes, np.sqrt(np.mean(beyond**2, axis=1)))

    def score_windows(self, windows: np.ndarray) -> np.ndarray:
        """Scores what `judged_series` returns in single windows of any order, without dividing by the threshold."""
        if self.name == RESIDUAL:
            return self._sizes(windows)
        return self.detector.score(self._judged(windows))

    def score_series(self, series: np.ndarray) -> np.ndarray:
        """Scores every sample of a series of `EnhancedSimulator.judged_series`, shape `(samples, channels)`, with at least a window of samples.

        Returns float64 of shape `(samples,)`, scaled so that the threshold is 1.
        """
        return self._relative(self._raw(np.asarray(series, np.float32)))

    def _relative(self, scores: np.ndarray) -> np.ndarray:
        """Scores beside the threshold, from which they are shifted if it is not positive."""
        return scores / self.threshold if self.threshold > 0 else 1 + scores - self.threshold


@threadpool_limits.wrap(limits=1)  # several threads take longer for arrays of this size
def score(
    simulator: EnhancedSimulator,
    telemetry: Recording,
    run: Recording | None = None,
    options: ScoreOptions | None = None,
) -> pd.DataFrame:
    """Scores every sample of telemetry.

    Args:
        simulator: The fitted simulator.
        telemetry: Telemetry of its channels, as returned by `joint.join_channels`.
        run: The coarse run of the same time, for a simulator of recorded runs.
        options: Options of the scoring. None uses the defaults.

    Returns:
        A data frame with the index of `to_series` and the columns `value` (of several channels, their names), with a run
        `enhanced` (of several channels, `enhanced NAME`), `score` (scaled so that the threshold is 1), `flag` (whether the score is above 1),
        with a lasting departure `score_after` (scores against the new operating point), and with a run `out_of_range` (above 1, the coarse run
        is outside the training range). Samples in parts shorter than a window, or without a run, have NaN in place of scores. `frame.attrs` holds
        `detector`, `expected_false_alarm_rate`, `events` (the rows of `events_table`), `false_alarms_per_day` (with its 95 % interval, on
        generated telemetry), `departure` (a sentence, or an empty text) and `counts` (whether the clock counts from zero).

    Raises:
        InputError: If channels, interval or run do not fit to the simulator, or if every part is shorter than a window.
    """
    check_fits(simulator, telemetry, run)
    scorer = Scorer(simulator, options)
    trusted = None if run is None else TrustedRange(simulator)
    values = telemetry.values
    scores, outside = np.full((2, len(values)), np.nan)
    enhanced, judged = np.full(values.shape, np.nan, np.float32), []
    for place, coarse in _stretches(simulator, telemetry, run):
        here = slice(place, place + len(coarse))
        seen = values[here]
        if run is not None:
            enhanced[here], outside[here] = simulator.enhance_run(coarse), trusted.score_run(coarse)
            seen = seen - enhanced[here]
        scores[here] = scorer.score_series(seen)
        judged.append((place, seen))
    if not judged:
        raise InputError(
            f"Expected a part of at least one window of {simulator.window} samples. Received: {counted(max(map(len, telemetry.parts)), 'sample')}. "
            "Give more telemetry."
        )
    single = len(simulator.channels) == 1
    columns = dict(zip(("value",) if single else simulator.channels, values.T, strict=True))
    if run is not None:
        names = ("enhanced",) if single else [f"enhanced {name}" for name in simulator.channels]
        columns |= dict(zip(names, enhanced.T, strict=True))
    columns |= {"score": scores, "flag": scores > 1} | (
        {} if run is None else {"out_of_range": outside}
    )
    frame = pd.DataFrame(columns, index=index_of(telemetry_of(telemetry)))
    departure, nominal = (
        find_departure(simulator, scorer.score_series, scores, judged),
        scorer.nominal_scores,
    )
    num_alarms, edges = (
        len(events_of(nominal > 1, gap=scorer.window)),
        np.cumsum([0, *map(len, telemetry.parts)]),
    )
    frame.attrs = {
        "detector": scorer.name,
        "expected_false_alarm_rate": scorer.rate,
        "false_alarms_per_day": list(
            false_alarms_per_day(num_alarms, len(nominal) * simulator.interval_s)
        ),
        "events": event_rows(
            scores, edges, nominal, scorer.window, simulator.interval_s, departure
        ),
        "counts": telemetry.clock().counts,
        "departure": "",
    }
    if departure is not None:
        frame["score_after"] = departure.scores
        frame.attrs["departure"] = _departure_text(frame, departure)
    return frame


def check_fits(simulator: EnhancedSimulator, telemetry: Recording, run: Recording | None) -> None:
    """Raises InputError if channels or interval differ, if a coarse run is missing, or if one is given that the simulator cannot use."""
    if (
        telemetry.columns != simulator.channels
        and not len(telemetry.columns) == len(simulator.channels) == 1
    ):
        raise InputError(
            f"Expected the channels {', '.join(simulator.channels)[:120]}. Received: {', '.join(telemetry.columns)[:120]}. Select them with --column."
        )
    if abs(telemetry.interval_s - simulator.interval_s) > SAME_RATE * simulator.interval_s:
        given = (f"every {telemetry.interval_s:g} s", "the same sampling interval, or --interval")
        received, give = (
            given if telemetry.start is not None else ("samples without times", "a time column")
        )
        raise InputError(
            f"Expected a sample every {simulator.interval_s:g} s, as in the telemetry of the fit. Received: {received}. Give telemetry with {give}."
        )
    if simulator.is_run_model and run is None:
        raise InputError(
            f"Expected the coarse run of the same time, because the simulator was fitted to runs of {simulator.alignment.name}. Received: none. "
            "Give it with --coarse."
        )
    if run is not None:
        simulator.recorded_runs()


def _stretches(
    simulator: EnhancedSimulator, telemetry: Recording, run: Recording | None
) -> list[tuple[int, np.ndarray]]:
    """The first sample and the coarse values of each stretch that can be scored; without a run, the telemetry itself."""
    places = np.cumsum([0, *map(len, telemetry.parts)])
    if run is None:
        return [
            (place, part.values)
            for place, part in zip(places, telemetry.parts, strict=False)
            if len(part) >= simulator.window
        ]
    found, (_, coarse) = [], simulator.alignment.pair(telemetry, run)
    for place, part in zip(places, telemetry.parts, strict=False):
        for stretch in coarse.parts:
            first = round((stretch.offset_s - part.offset_s) / telemetry.interval_s)
            if 0 <= first < len(part):
                found.append((place + first, stretch.values))
    return found


def _departure_text(frame: pd.DataFrame, departure: Departure) -> str:
    when = told_times(frame, frame.index[[departure.begin]])[0]
    when = f"{when:.10g} s" if isinstance(when, float) else when
    moved = (
        "."
        if departure.settled is not None
        else ", which a moved level and amplitude do not reach, so they are no events."
    )
    return (
        f"1 lasting departure since {when}: the telemetry has left what was learnt and stays there ({', '.join(departure.what)}). It is a lasting "
        f"fault, or the new normal: then go on with `update`. score_after are scores against the new operating point{moved}"
    )


def event_rows(
    scores: np.ndarray,
    edges: Sequence[int],
    nominal_scores: np.ndarray,
    window: int,
    interval_s: float,
    departure: Departure | None = None,
) -> list[dict]:
    """Returns the events in plain JSON types; flags of a part within a window of each other are one event, as they share windows.

    `edges` are the first samples of the parts and the number of samples. From the first sample of a departure on, all is one event against what
    was learnt, and alarms of its own scores are events against the new operating point.
    """
    end = len(scores) if departure is None else departure.begin
    found = [(LEARNT, scores, event) for event in _events(scores, 0, end, edges, window)]
    if departure is not None:
        found.append(
            (LEARNT, scores, Event(end, len(scores), end + int(np.nanargmax(scores[end:]))))
        )
        if departure.settled is not None:
            later = _events(departure.scores, departure.settled, len(scores), edges, window)
            found += [(NEW, departure.scores, event) for event in later]
    peaks = [float(own[event.peak]) for _, own, event in found]
    return [
        {
            "begin": event.begin,
            "end": event.end,
            "peak": event.peak,
            "duration_s": (event.end - event.begin) * interval_s,
            "num_flagged": int((own[event.begin : event.end] > 1).sum()),
            "score": peak,
            "confidence": float(confidence),
            "against": against,
        }
        for (against, own, event), peak, confidence in zip(
            found, peaks, confidences(peaks, nominal_scores, window), strict=True
        )
    ]


def _events(
    scores: np.ndarray, begin: int, end: int, edges: Sequence[int], window: int
) -> list[Event]:
    """The events of each part among the samples from `begin` to `end`."""
    found = []
    for first, last in itertools.pairwise(np.clip(edges, begin, end).tolist()):
        own = scores[first:last]
        found += [
            Event(*(first + place for place in event)) for event in events_of(own > 1, own, window)
        ]
    return found


def told_times(frame: pd.DataFrame, index: pd.Index | None = None) -> pd.Index:
    """Returns times of scores, those of all samples if none are given, as they are written: of a clock that counts from zero in seconds."""
    index = frame.index if index is None else index
    if not frame.attrs["counts"]:
        return index
    return pd.Index((index - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1), name=index.name)


def events_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Returns the events in the scores that `score` returns, one row per alarm.

    Runs of flags that are at most one window apart are one event; so is a lasting departure. The columns are `begin`, `end` and `peak` (times of
    the first flagged sample, of the sample after the last one, and of the highest score; sample numbers if the telemetry has no times),
    `duration_s`, `num_flagged`, `score` (the highest score; the threshold is 1), `confidence` (see `events.confidences`), and `against`: what was
    `LEARNT`, or within a lasting departure the `NEW` operating point, with `num_flagged` and `score` of `score_after`.
    """
    names = ["begin", "end", "peak", "duration_s", "num_flagged", "score", "confidence", "against"]
    table = pd.DataFrame(frame.attrs["events"], columns=names)
    index, (begin, end, peak) = frame.index, table[["begin", "end", "peak"]].to_numpy(int).T
    step = (
        pd.to_timedelta(table["duration_s"].to_numpy(float) / (end - begin), unit="s").round("us")
        if hasattr(index, "tz")
        else 1
    )
    places = {"begin": index[begin], "end": index[end - 1] + step, "peak": index[peak]}
    return table.assign(**{name: told_times(frame, place) for name, place in places.items()})


def events_path(path: str | os.PathLike) -> Path:
    """Returns the path of the events beside a file of scores, for example `scores.events.csv` beside `scores.parquet`."""
    return Path(path).with_suffix(".events.csv")


def write_scores(path: str | os.PathLike, frame: pd.DataFrame) -> None:
    """Writes what `score` returns to a `.parquet` or `.csv` file, and the events to `events_path`. Both files appear when they are complete."""
    plain = frame.set_axis(told_times(frame))
    plain.attrs = {}  # Parquet would store them as JSON
    with replace_file(path) as temporary, replace_file(events_path(path)) as events:
        events_table(frame).to_csv(events, index=False)
        if Path(path).suffix == ".csv":
            plain.to_csv(temporary)
        else:
            plain.to_parquet(
                temporary, index=True
            )  # sample numbers, too, are a column for every reader
