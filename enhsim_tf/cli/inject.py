"""`enhsim-tf inject`: puts labelled anomalies into nominal telemetry."""

import argparse
import os

from enhsim_tf.cli.options import cleaned_channels, for_each, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted, spoken
from enhsim_tf.datasets.inject import inject, join_injected
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
    files = {"all channels": list(series)} if is_one_file else {name: [name] for name in series}
    paths = output_paths(options.out, files, suffixes)
    refuse_same_file(paths.values(), options.source)

    def write(file: str) -> None:
        channels, path = files[file], paths[file]
        if chosen.is_joint:
            telemetry, cleaned = cleaned_channels(series, {name: name for name in channels}, cleaning)
            tables = {spoken(channels): inject(telemetry, chosen)}
        else:
            cleaned = {name: clean(series[name], cleaning) for name in channels}
            tables = {name: inject(each.parts, chosen) for name, each in cleaned.items()}
        frame = join_injected(tables) if len(tables) > 1 else next(iter(tables.values()))
        write_table(path, frame, channels if options.timeeval else ())
        if options.figure:
            from enhsim_tf.simulator.figures import inject_figure  # matplotlib is slow to import

            inject_figure(frame, channels).savefig(path.with_suffix(".png"), dpi=200, format="png")
        lines = lines_of([each.report for each in cleaned.values()])
        said = "given" if chosen.noise_sd is not None else "estimated from second differences"
        for name, table in tables.items():
            number, changed = counted(len(table.attrs["anomalies"]), "anomaly"), counted(int(table["mask"].sum()), "sample")
            noise = "" if chosen.is_joint else f"; noise sd {table.attrs['noise_sd']:.4g} ({said})"
            lines.append(f"{spoken([name])}: {number}, {changed} of {len(table):,} changed{noise}; in {path}")
        tell("\n".join(lines))

    return for_each(files, write)
