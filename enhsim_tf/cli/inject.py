"""`enhsim-tf inject`: puts labelled anomalies into nominal telemetry."""

import argparse
import os

from enhsim_tf.cli.options import cleaned_channels, for_each, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted, spoken
from enhsim_tf.datasets.inject import inject
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.telemetry.cleaning.report import lines_of
from enhsim_tf.telemetry.sources import read_source


def run_inject(options: argparse.Namespace) -> int:
    """Injects anomalies into each channel of the source, or into one table of all of them, and returns the exit code."""
    chosen, cleaning = options.chosen, options.cleaning
    series = read_source(options.source, options.column, options.time, cleaning)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv")
    is_one_table = chosen.is_joint or (
        options.out.suffix in suffixes and not os.path.isdir(options.out)
    )
    files = {"all channels": list(series)} if is_one_table else {name: [name] for name in series}
    paths = output_paths(options.out, files, suffixes)
    refuse_same_file(paths.values(), options.source)

    def write(file: str) -> None:
        channels, path = files[file], paths[file]
        telemetry, cleaned = cleaned_channels(series, {name: name for name in channels}, cleaning)
        frame = inject(telemetry, chosen)
        write_table(path, frame, channels if options.timeeval else ())
        if options.figure:
            from enhsim_tf.simulator.figures import inject_figure  # matplotlib is slow to import

            inject_figure(frame, channels).savefig(path.with_suffix(".png"), dpi=200, format="png")
        lines = lines_of([each.report for each in cleaned.values()])
        number, changed = (
            counted(len(frame.attrs["anomalies"]), "anomaly"),
            counted(int(frame["mask"].sum()), "sample"),
        )
        said = "given" if chosen.noise_sd is not None else "estimated from second differences"
        noise = "" if len(channels) > 1 else f"; noise sd {frame.attrs['noise_sd']:.4g} ({said})"
        tell(
            "\n".join(
                [
                    *lines,
                    f"{spoken(channels)}: {number}, {changed} of {len(frame):,} changed{noise}; in {path}",
                ]
            )
        )

    return for_each(files, write)
