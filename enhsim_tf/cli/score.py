"""`enhsim-tf score`: scores telemetry with a detector that has learnt from generated telemetry."""

import argparse
import json
from pathlib import Path

import pandas as pd

from enhsim_tf.cli.options import (
    channels_by_model,
    cleaned_channels,
    for_each,
    output_paths,
    refuse_same_file,
    run_for,
)
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted, printable, spoken
from enhsim_tf.simulator.model_folder import models_of
from enhsim_tf.simulator.scoring import NEW, events_path, events_table, score, write_scores
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.sources import read_source


def run_score(options: argparse.Namespace) -> int:
    """Scores the channels of the source with their simulators and returns the exit code."""
    models, cleaning = models_of(options.models), options.cleaning
    series = read_source(options.source, options.column, options.time, cleaning)
    channels = channels_by_model(series, models)
    source_names = {
        model: next(iter(names.values())) if len(names) == 1 else model
        for model, names in channels.items()
    }
    paths = dict(
        zip(
            channels,
            output_paths(options.out, source_names.values(), (".parquet", ".csv")).values(),
            strict=True,
        )
    )
    refuse_same_file([*paths.values(), *map(events_path, paths.values())], options.source)
    found = {}

    def write(model: str) -> None:
        telemetry, cleaned = cleaned_channels(series, channels[model], cleaning)
        simulator = EnhancedSimulator.load(models[model])
        run = run_for(simulator, series, options, cleaning)
        frame = score(simulator, telemetry, run, options.chosen)
        write_scores(paths[model], frame)
        if options.figure:
            from enhsim_tf.simulator.figures import score_figure  # matplotlib is slow to import

            score_figure(frame, simulator, spoken(simulator.channels)).savefig(
                paths[model].with_suffix(".png"), dpi=200, format="png"
            )
        found[source_names[model]] = {
            "scores": str(paths[model]),
            "detector": frame.attrs["detector"],
            "keeps_promise": simulator.trained.get("keeps_promise", True),
            "flagged": float(frame["flag"].mean()),
            "departure": frame.attrs["departure"],
            "false_alarms_per_day": frame.attrs["false_alarms_per_day"],
            "events": json.loads(events_table(frame).to_json(orient="records", date_format="iso")),
        }
        if not options.json:
            notes = [
                f"{printable(model)}: {note}" for note in (run.notes if run is not None else ())
            ]
            lines = lines_of([each.report for each in cleaned.values()])
            if not found[source_names[model]]["keeps_promise"]:
                flagged = f"{simulator.trained['false_alarms']:.0%} were flagged at 1 % set"
                lines.insert(
                    0,
                    f"{spoken(simulator.channels)}: WARNING: on held-out nominal time {flagged}, so do not trust these alarms",
                )
            tell("\n".join([*lines, *notes, *_said(frame, simulator, paths[model])]))

    code = for_each(channels, write)
    if options.json:
        tell(json.dumps(found))
    return code


def _said(frame: pd.DataFrame, simulator: EnhancedSimulator, path: Path) -> list[str]:
    name, lines = spoken(simulator.channels), []
    if frame.attrs["departure"]:
        lines.append(f"{name}: {frame.attrs['departure']}")
    left, num_flags = int(frame["score"].isna().sum()), int(frame["flag"].sum())
    scored = len(frame) - left
    line = (
        f"{name}: {num_flags:,} of {counted(scored, 'scored sample')} ({num_flags / max(scored, 1):.1%}) flagged by {frame.attrs['detector']}, set to flag "
        f"{frame.attrs['expected_false_alarm_rate']:.1%} of nominal samples"
    )
    if left:
        line += f"; {counted(left, 'sample')} not scored, in parts shorter than a window or without a coarse run"
    if "out_of_range" in frame:
        outside = float((frame["out_of_range"] > 1).sum())
        line += f"; {outside / max(scored, 1):.1%} outside the training range" if outside else ""
    (expected, low, high), found = frame.attrs["false_alarms_per_day"], frame.attrs["events"]
    later = counted(sum(event["against"] == NEW for event in found), "event")
    kinds = (
        f" (1 lasting departure; {later} against the new operating point)"
        if frame.attrs["departure"]
        else ""
    )
    unit = "day" if hasattr(frame.index, "tz") else "86,400 samples"
    events = (
        f"{counted(len(found), 'event')} in {events_path(path)}{kinds}; on generated nominal telemetry {expected:.3g} false alarms per {unit} "
        f"(95 % interval {low:.3g} to {high:.3g})"
    )
    return [*lines, f"{line}; in {path}", f"{name}: {events}"]
