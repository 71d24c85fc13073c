"""`enhsim-tf inject`: puts labelled anomalies into nominal telemetry."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from enhsim_tf.cli.options import cleaned_channels, cleaning_options, counted, for_each, output_paths, refuse_same_file
from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import InputError, printable

if TYPE_CHECKING:
    import pandas as pd


def run_inject(options: argparse.Namespace) -> int:
    """Injects anomalies into each channel of the source and returns the exit code.

    Args:
        options: Parsed options of `inject`.
    """
    from enhsim_tf.datasets.inject import InjectOptions, inject_channel
    from enhsim_tf.datasets.label_columns import write_table, write_timeeval
    from enhsim_tf.datasets.places import split_limits
    from enhsim_tf.detection.anomalies import INJECTIONS

    kinds = tuple(INJECTIONS) if options.kinds == "all" else tuple(filter(None, (options.kinds or "").split(",")))
    from enhsim_tf.datasets.inject_joint import JOINT_KINDS

    severity, length = (split_limits(name, getattr(options, name)) for name in ("severity", "length"))
    try:
        degrees = (float(severity[0]), float(severity[1]))
    except ValueError:
        raise InputError(f"Expected a severity such as 4 or 2:8. Received: --severity {options.severity}.") from None
    if set(kinds) & set(JOINT_KINDS):
        return _inject_joint(options, kinds, degrees, length)
    chosen = InjectOptions(kinds, degrees, length, options.number, tuple(options.at), options.gap, options.noise_sd, options.seed)
    cleaning = cleaning_options(options, 3)
    from enhsim_tf.telemetry.cleaning.clean import clean
    from enhsim_tf.telemetry.sources import read_source

    series = read_source(options.source, options.column, options.time, cleaning)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv")
    is_joint = options.timeeval and options.out.suffix in suffixes and not os.path.isdir(options.out)
    names = ["all channels"] if is_joint else list(series)
    paths = output_paths(options.out, names, suffixes)
    refuse_same_file(paths.values(), options.source)

    def make(channel: str, path: Path) -> "pd.DataFrame":
        cleaned = clean(series[channel], cleaning)
        frame = inject_channel(cleaned.parts, chosen)
        said = "given" if chosen.noise_sd is not None else "estimated from second differences"
        lines = [
            *cleaned.report.lines(),
            f"{printable(channel)}: {counted(len(frame.attrs['anomalies']), 'anomaly').replace('anomalys', 'anomalies')}, "
            f"{counted(int(frame['mask'].sum()), 'sample')} of {len(frame):,} changed; noise sd {frame.attrs['noise_sd']:.4g} ({said}); in {path}",
        ]
        frame.attrs["lines"] = "\n".join(lines)
        return frame

    def write(channel: str) -> None:
        frame = make(channel, paths[channel])
        if options.timeeval:
            write_timeeval(paths[channel], {channel: frame})
        else:
            write_table(paths[channel], frame)
        tell(frame.attrs["lines"])

    if not is_joint:
        return for_each(series, write)
    (path,) = paths.values()
    frames = {channel: make(channel, path) for channel in series}
    write_timeeval(path, frames)
    for frame in frames.values():
        tell(frame.attrs["lines"])
    return 0


def _inject_joint(options: argparse.Namespace, kinds: tuple[str, ...], severity: tuple[float, float], length: tuple[str, str]) -> int:
    """Injects anomalies of several channels into one table."""
    from enhsim_tf.datasets.inject_joint import inject_joint
    from enhsim_tf.datasets.label_columns import write_table, write_timeeval
    from enhsim_tf.telemetry.cleaning.report import lines_of
    from enhsim_tf.telemetry.sources import read_source

    if options.at or options.noise_sd is not None:
        raise InputError(f"Expected drawn places and the estimated noise with {kinds[0]}. Received: --at or --noise-sd. Leave it out.")
    cleaning = cleaning_options(options, 3)
    series = read_source(options.source, options.column, options.time, cleaning)
    suffixes = (".csv",) if options.timeeval else (".parquet", ".csv")
    (path,) = output_paths(options.out, ["all channels"], suffixes).values()
    refuse_same_file([path], options.source)
    telemetry, cleaned = cleaned_channels(series, {name: name for name in series}, cleaning)
    frame = inject_joint(telemetry, kinds, options.number, severity, length, options.gap, options.seed)
    if options.timeeval:
        write_timeeval(path, {name: frame[[name, "mask"]].rename(columns={name: "value"}) for name in telemetry.columns})
    else:
        write_table(path, frame)
    lines = lines_of([each.report for each in cleaned.values()])
    lines += [
        f"{kind} of {printable(channel)} from sample {begin:,} to {end:,}" for kind, _, begin, end, channel in frame.attrs["anomalies"]
    ]
    tell(
        "\n".join(
            [*lines, f"{printable(telemetry.name)}: {counted(int(frame['mask'].sum()), 'sample')} of {len(frame):,} changed; in {path}"]
        )
    )
    return 0
