"""`enhsim-tf score`: scores telemetry by how it differs from nominal telemetry."""

import argparse
import json
from pathlib import Path

from enhsim_tf.cli.shared import (
    channels_by_model,
    for_each,
    on_one_clock,
    output_paths,
    read_channels,
    refuse_same_file,
    run_for,
)
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted, printable, spoken
from enhsim_tf.scoring.events import NEW
from enhsim_tf.scoring.score import (
    ScoredTelemetry,
    events_path,
    events_table,
    score,
    write_scores,
)
from enhsim_tf.simulator.model_folder import models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.report import lines_of


def run_score(options: argparse.Namespace) -> int:
    """Scores the channels of the source with their simulators and returns the exit code."""
    models = models_of(options.models)
    series = read_channels(options)
    channels = channels_by_model(series, models, some_suffice=True)
    # a single channel may have another name in the source
    source_names = {
        model: next((raw.name for channel, raw in given.items() if raw.name != channel), model)
        for model, given in channels.items()
    }
    files = output_paths(options.out, source_names.values(), (".parquet", ".csv"))
    paths = {model: files[name] for model, name in source_names.items()}
    refuse_same_file([*paths.values(), *map(events_path, paths.values())], options.source)
    results = {}

    def write(model: str) -> None:
        left: dict[str, Exception] = {}
        telemetry, reports = on_one_clock(channels[model], options.cleaning, left)
        simulator = EnhancedSimulator.load(models[model])
        run = run_for(simulator, series, options)
        scored = score(simulator, telemetry, run, options.chosen)
        write_scores(paths[model], scored)
        if options.figure:
            from enhsim_tf.scoring.figure import score_figure  # matplotlib is slow to import

            score_figure(scored, spoken(simulator.channels)).savefig(
                paths[model].with_suffix(".png"), dpi=200, format="png"
            )
        results[source_names[model]] = {
            "scores": str(paths[model]),
            "flagged": float(scored.table["flag"].mean()),
            "departure": scored.departure,
            "not_judged": scored.not_judged,
            "false_alarms_per_day": scored.false_alarms_per_day,
            "events": json.loads(events_table(scored).to_json(orient="records", date_format="iso")),
        }
        if not options.json:
            notes = [
                f"{printable(model)}: {note}" for note in (run.notes if run is not None else ())
            ]
            lines = lines_of(list(reports.values()))
            for name in scored.not_judged:
                reason = left.get(name, "it is not in the source")
                lines.append(f"{printable(name)}: not judged: {reason}")
            wanted = options.chosen.false_alarm_rate
            tell("\n".join([*lines, *notes, *_said(scored, simulator, paths[model], wanted)]))

    code = for_each(channels, write)
    if options.json:
        tell(json.dumps(results))
    return code


def _said(
    scored: ScoredTelemetry, simulator: EnhancedSimulator, path: Path, wanted: float
) -> list[str]:
    name = spoken(simulator.channels)
    lines = []
    table = scored.table
    departure = scored.departure
    if departure:
        lines.append(f"{name}: {departure}")
    left = int(table["score"].isna().sum())
    num_flags = int(table["flag"].sum())
    num_scored = len(table) - left
    line = (
        f"{name}: {num_flags:,} of {counted(num_scored, 'scored sample')} "
        f"({num_flags / max(num_scored, 1):.1%}) flagged, set to flag "
        f"{scored.false_alarm_rate:.1%} of nominal samples"
    )
    if scored.false_alarm_rate > wanted:
        line += f", of which there are too few for {100 * wanted:g}%"
    if left:
        line += f"; {counted(left, 'sample')} not scored, in parts shorter than a window or "
        line += "without a coarse run"
    if "out_of_range" in table:
        outside = float((table["out_of_range"] > 1).sum())
        line += (
            f"; {outside / max(num_scored, 1):.1%} outside the training range" if outside else ""
        )
    expected, low, high = scored.false_alarms_per_day
    later = counted(sum(event.against == NEW for event in scored.events), "event")
    kinds = f" (1 lasting departure; {later} against the new operating point)" if departure else ""
    unit = "day" if hasattr(table.index, "tz") else "86,400 samples"
    events = (
        f"{counted(len(scored.events), 'event')} in {events_path(path)}{kinds}; on the nominal "
        f"telemetry {expected:.3g} false alarms per {unit} "
        f"(95 % interval {low:.3g} to {high:.3g})"
    )
    return [*lines, f"{line}; in {path}", f"{name}: {events}"]
