"""`python -m enhsim_tf score`: scores telemetry with a detector trained on generated data."""

import argparse
from pathlib import Path

from enhsim_tf.cli.options import cleaning_options, counted, events_line, for_each, load, model_names, output_paths, refuse_same_file
from enhsim_tf.cli.runs import refuse_without_coarse
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import printable


def run_score(options: argparse.Namespace) -> int:
    """Scores each channel of the source with its simulator and returns the exit code.

    Args:
        options: Parsed options of `score`.
    """
    from enhsim_tf.detection.registry import DETECTORS, RESIDUAL, option_name
    from enhsim_tf.enhanced_simulator.scoring import ScoreOptions, events_path, score_channel, write_scores

    detector = {option_name(name): name for name in (*DETECTORS, RESIDUAL)}[options.detector]
    chosen = ScoreOptions(detector, options.windows, options.false_alarm_rate, options.seed)
    cleaning = cleaning_options(options, 2)
    from enhsim_tf.enhanced_simulator.model_folder import models_of
    from enhsim_tf.telemetry.cleaning.clean import clean
    from enhsim_tf.telemetry.sources import read_source

    models = models_of(options.models)
    series = read_source(options.source, options.column, options.time, cleaning)
    names = model_names(series, models)
    series, models = {name: series[name] for name in names}, {name: models[model] for name, model in names.items()}
    paths = output_paths(options.out, series, (".parquet", ".csv"))
    refuse_same_file([*paths.values(), *map(events_path, paths.values())], options.source)

    if options.coarse is not None or all(map(_is_of_commands, (models[name] for name in series))):
        from enhsim_tf.cli.runs import score_runs

        return score_runs(options, series, models, paths, chosen, cleaning)
    refuse_without_coarse(options, "coarse_time", "coarse_start")

    def write(channel: str) -> None:
        cleaned = clean(series[channel], cleaning)
        simulator = load(models[channel])
        frame = score_channel(simulator, cleaned.parts, chosen)
        write_scores(paths[channel], frame)
        tell("\n".join(cleaned.report.lines()))
        if hasattr(simulator, "nominal"):
            tell(
                f"{printable(channel)}: without --coarse, the values are judged, not their difference from an enhanced run of the same time"
            )
        left, num_flags = int(frame["score"].isna().sum()), int(frame["flag"].sum())
        scored, rate = len(frame) - left, frame.attrs["expected_false_alarm_rate"]
        tell(
            f"{printable(channel)}: {num_flags:,} of {counted(scored, 'scored sample')} ({num_flags / scored:.1%}) flagged by {chosen.detector}, "
            f"set to flag {rate:.1%} of generated nominal samples"
            + (
                f" (too few windows for {chosen.false_alarm_rate:.2g}: the threshold is their largest score)"
                if rate > chosen.false_alarm_rate
                else ""
            )
            + (f"; {counted(left, 'sample')} not scored, in parts shorter than a window" if left else "")
            + f"; in {paths[channel]}"
        )
        tell(f"{printable(channel)}: {events_line(frame, paths[channel])}")

    return for_each(series, write)


def _is_of_commands(folder: Path) -> bool:
    """Whether the model in a folder was fitted to the commands of a file of telemetry."""
    from enhsim_tf.enhanced_simulator.saving import settings_of

    kept = settings_of(folder).get("trained", {}).get("coarse", {})
    return isinstance(kept, dict) and kept.get("kind") == "commands"
