"""`enhsim-tf inject`: puts labelled anomalies into nominal telemetry."""

import argparse
import os
from pathlib import Path

import pandas as pd

from enhsim_tf.cli.options import cleaned_channels, counted, for_each, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import printable
from enhsim_tf.datasets.inject import inject_channel, inject_joint, join_injected
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.sources import read_source


def run_inject(options: argparse.Namespace) -> int:
    """Injects anomalies into each channel of the source, or into all of them together, and returns the exit code."""
    chosen, cleaning = options.chosen, options.cleaning
    series = read_source(options.source, options.column, options.time, cleaning)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv")
    is_one_file = chosen.is_joint or (options.timeeval and options.out.suffix in suffixes and not os.path.isdir(options.out))
    paths = output_paths(options.out, ["all channels"] if is_one_file else series, suffixes)
    refuse_same_file(paths.values(), options.source)

    def inject(channel: str, path: Path) -> tuple[pd.DataFrame, str]:
        cleaned = clean(series[channel], cleaning)
        frame = inject_channel(cleaned.parts, chosen)
        said = "given" if chosen.noise_sd is not None else "estimated from second differences"
        number = len(frame.attrs["anomalies"])
        what = f"{number:,} {'anomaly' if number == 1 else 'anomalies'}, {_changed(frame)}; noise sd {frame.attrs['noise_sd']:.4g} ({said})"
        return frame, "\n".join([*cleaned.report.lines(), f"{printable(channel)}: {what}; in {path}"])

    def write(channel: str) -> None:
        frame, text = inject(channel, paths[channel])
        write_table(paths[channel], frame, [channel] if options.timeeval else ())
        tell(text)

    if not is_one_file:
        return for_each(series, write)
    (path,) = paths.values()
    if chosen.is_joint:
        telemetry, cleaned = cleaned_channels(series, {name: name for name in series}, cleaning)
        frame = inject_joint(telemetry, chosen)
        lines = lines_of([each.report for each in cleaned.values()])
        for kind, _, begin, end, channel in frame.attrs["anomalies"]:
            lines.append(f"{kind} of {printable(channel)} from sample {begin:,} to {end:,}")
        lines.append(f"{printable(telemetry.name)}: {_changed(frame)}; in {path}")
    else:
        made = {channel: inject(channel, path) for channel in series}
        frame, lines = join_injected({channel: each for channel, (each, _) in made.items()}), [text for _, text in made.values()]
    write_table(path, frame, list(series) if options.timeeval else ())
    tell("\n".join(lines))
    return 0


def _changed(frame: pd.DataFrame) -> str:
    return f"{counted(int(frame['mask'].sum()), 'sample')} of {len(frame):,} changed"
