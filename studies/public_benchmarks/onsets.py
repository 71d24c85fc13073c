"""How well events of `score` tell when an anomaly began, where that is known: anomalies of `inject`
in nominal time that was not learnt, and the faults of the examples.
"""

import contextlib
import io
import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.__main__ import main
from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.datasets.example import example
from enhsim_tf.scoring.score import events_path, score
from enhsim_tf.telemetry.windows import runs_of
from studies.common.settings import Settings
from studies.public_benchmarks.arms import Simulators, telemetry_of, window_of
from studies.public_benchmarks.judging import Judge
from studies.public_benchmarks.series import Series
from studies.public_benchmarks.tool import times_of

ABRUPT = "abrupt"
DRIFT = "drift"
EXAMPLES = "examples"
GROUPS: Mapping[str, str] = {kind: DRIFT if kind == "ramp" else ABRUPT for kind in INJECTIONS}
"""Whether an anomaly is there from its first sample on or grows."""
SEVERITIES = (1.0, 2.0, 4.0)
"""In nominal standard deviations of the channel."""
# of a series in which an anomaly is injected, in windows: before, during and after it
_BEFORE = 4
_DURING = 2
_AFTER = 2


class Place(NamedTuple):
    """A piece of a judged series, and the samples of it that are changed."""

    first: int
    last: int
    begin: int
    end: int


def draw_place(judge: Judge, rng: np.random.Generator) -> Place | None:
    """Draws a piece of nominal time; None if none is long enough."""
    window = judge.window
    length = (_BEFORE + _DURING + _AFTER) * window
    runs = [(first, last) for first, last in runs_of(judge.is_nominal) if last - first >= length]
    if not runs:
        return None
    starts = np.concatenate([np.arange(first, last - length + 1) for first, last in runs])
    first = int(rng.choice(starts))
    return Place(first, first + length, _BEFORE * window, (_BEFORE + _DURING) * window)


def onset_rows(series: Series, settings: Settings, seed: int) -> list[dict[str, Any]]:
    """A row for each kind and severity of anomaly: `onset_error` and `delay` of its event in
    samples, NaN if it is not found; see `tool.times_of`.
    """
    simulator = Simulators(seed).fitted(series.nominal)
    judge = Judge(series.events, len(series.judged), window_of(series.nominal))
    deviation = series.nominal.std(axis=0)
    units = np.where(deviation > 0, deviation, 1.0)
    rng = np.random.default_rng([seed, 67])
    severities = SEVERITIES[: settings.public_benchmarks.num_tried]
    rows = []
    for kind, severity in itertools.product(INJECTIONS, severities):
        place = draw_place(judge, rng)
        if place is None:
            break
        values = series.judged[place.first : place.last].copy()
        changed = slice(place.begin, place.end)
        channel = int(rng.integers(values.shape[1]))
        values[changed, channel] = INJECTIONS[kind](
            values[None, changed, channel],
            severity * units[channel],
            values[None, :, channel].mean(axis=1, keepdims=True),
            rng,
        )[0]
        events = score(simulator, telemetry_of(values)).events
        onset_error, delay = times_of(events, ((place.begin, place.end),))
        row = {"kind": kind, "severity": severity, "onset_error": onset_error, "delay": delay}
        rows.append(row)
    return rows


class Fault(NamedTuple):
    """An example in which a fault begins at a known time.

    Args:
        fit: Arguments of `python -m enhsim_tf fit`, without `--out`.
        score: Arguments of `score` behind the simulator, without `--out`.
        begin_s: When the fault begins, in seconds.
        interval_s: Sampling interval in seconds.
    """

    fit: tuple[str | Path, ...]
    score: tuple[str | Path, ...]
    begin_s: float
    interval_s: float


def _recorded(name: str, window: str, begin_s: float, interval_s: float) -> Fault:
    """The fault of a recorded pair in `examples`."""
    folder = Path(__file__).resolve().parents[2] / "examples" / name
    nominal = (folder / "telemetry.csv", "--coarse", folder / "simulator.csv", "--window", window)
    faulty = (folder / "telemetry_fault.csv", "--coarse", folder / "simulator_planned.csv")
    return Fault(nominal, faulty, begin_s, interval_s)


FAULTS: Mapping[str, Fault] = {
    "heater": Fault((example("nominal.csv"),), (example("new.csv"),), 400.0, 1.0),
    "battery": _recorded("battery", "100", 5_700.0, 10.0),
    "aircraft": _recorded("aircraft", "120", 300.0, 1.0),
}


def example_rows(folder: Path) -> list[dict[str, Any]]:
    """A row for each example, by the commands of README and docs; see `onset_rows`.

    Args:
        folder: Folder for models and scores.
    """
    import pandas as pd

    rows = []
    for name, fault in FAULTS.items():
        model = folder / name
        scores = folder / f"{name}.csv"
        for words in (
            ("fit", *fault.fit, "--out", model),
            ("score", model, *fault.score, "--out", scores),
        ):
            with contextlib.redirect_stdout(io.StringIO()):
                code = main([*map(str, words)])
            if code:
                raise RuntimeError(f"Expected commands that end well. Received: {words}.")
        events = pd.read_csv(events_path(scores))
        places = (events[["begin", "detected"]] / fault.interval_s).itertuples(index=False)
        begin = round(fault.begin_s / fault.interval_s)
        onset_error, delay = times_of(list(places), ((begin, begin + 1_000_000),))
        rows.append({"kind": name, "onset_error": onset_error, "delay": delay})
    return rows
