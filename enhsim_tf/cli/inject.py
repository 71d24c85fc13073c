"""`enhsim-tf inject`: puts labelled anomalies into nominal telemetry."""

import argparse
import os

from enhsim_tf.cli.shared import (
    for_each,
    on_one_clock,
    output_paths,
    read_channels,
    refuse_same_file,
)
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import MANY, InputError, counted, named, spoken
from enhsim_tf.datasets.inject import inject
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.telemetry.cleaning.report import lines_of


def run_inject(options: argparse.Namespace) -> int:
    """Injects anomalies into each channel of the source, or into one table of all of them, and
    returns the exit code.
    """
    chosen = options.chosen
    series = read_channels(options)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv")
    is_one_table = chosen.is_joint or (
        options.out.suffix in suffixes and not os.path.isdir(options.out)
    )
    files = {"all channels": list(series)} if is_one_table else {name: [name] for name in series}
    paths = output_paths(options.out, files, suffixes)
    refuse_same_file(paths.values(), options.source)

    many = len(files) > MANY
    written = []
    constant = []

    def write(file: str) -> None:
        channels = files[file]
        path = paths[file]
        given = {name: series[name] for name in channels}
        telemetry, by_channel = on_one_clock(given, options.cleaning)
        reports = list(by_channel.values())
        if len(files) > 1 and reports[0].find("constant"):
            constant.append(file)
            return
        injected = inject(telemetry, chosen)
        table = injected.table
        write_table(path, table, channels if options.timeeval else ())
        if options.figure:
            from enhsim_tf.datasets.figure import inject_figure  # matplotlib is slow to import

            figure = inject_figure(injected, channels)
            figure.savefig(path.with_suffix(".png"), dpi=200, format="png")
        written.append((reports[0], len(injected.anomalies)))
        if many:
            return
        number = counted(len(injected.anomalies), "anomaly")
        changed = counted(int(table["mask"].sum()), "sample")
        said = "given" if chosen.noise_sd is not None else "estimated from second differences"
        noise = "" if len(channels) > 1 else f"; noise sd {injected.noise_sd[0]:.4g} ({said})"
        line = (
            f"{spoken(channels)}: {number}, {changed} of {len(table):,} changed{noise}; in {path}"
        )
        tell("\n".join([*lines_of(reports), line]))

    code = for_each(files, write)
    if constant:
        tell(f"left out, as they never vary: {named(constant)}")
    if many and written:
        total = counted(sum(number for _, number in written), "anomaly")
        lines = lines_of([report for report, _ in written])
        tell("\n".join([*lines, f"{len(written):,} channels: {total}; in {options.out}"]))
    if constant and not written and not code:
        raise InputError(
            f"Expected a channel that varies. Received: constant ones only, {named(constant)}."
        )
    return code
