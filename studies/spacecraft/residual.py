"""`python -m studies.spacecraft.residual --data FOLDER`: the residual detector on the labelled channels.

At equal data, it is compared with the same detector whose enhancer is ridge regression, with the one-line controls and with left discord:
each learns from all of the `train` part. The test part is judged as in the study of `run`: false alarms at the threshold for 1 %, finds at
matched false-alarm rates, and the area under the precision-recall curve. The scores of the detectors are computed here; nothing is read
from the study except fitted simulators.
"""

import argparse
import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.console import Parser, run_command, tell
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.telemanom import LabelledChannel, load_channel, read_labels
from studies.common.settings import Settings, make_settings

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

TABLE = "residual.csv"
"""Name of the table, in the folder of the study."""
NETWORK, RIDGE = "residual", "ridge residual"
"""Residual detectors by their enhancer: the network of the study, and ridge regression."""
BOUNDS = {"": 1.0, ", scale followed": 1.5}
"""Endings of their names with the bounds of their scale."""
RESIDUALS = tuple(name + ending for name in (NETWORK, RIDGE) for ending in BOUNDS)
DISCORD = "left discord"
CONTROLS = ("largest step", "moving deviation", "limit check")
ONE_LINE = CONTROLS[:2]
_SERIES = 1_000  # length in windows of the generated series that sets the threshold, as in `score`


def ridge_simulator(channel: LabelledChannel, settings: Settings) -> "EnhancedSimulator":
    """Fits a simulator without a network to the train part of a channel: ridge regression, and whole windows of its residuals.

    Args:
        channel: The channel.
        settings: Settings of the study; `labelled` and `seed` are used.
    """
    from enhsim_tf.enhanced_simulator.fit_options import FitOptions
    from enhsim_tf.enhanced_simulator.fitting import fit_simulator

    options = FitOptions(
        num_windows=settings.labelled.num_windows, noise="residual windows", held_out=0.0, seed=settings.seed, enhancer="ridge"
    )
    return fit_simulator([channel.train], options, 0)


def judge_channel(channel: LabelledChannel, simulators: "Mapping[str, EnhancedSimulator]", settings: Settings) -> "list[dict[str, Any]]":
    """Judges all detectors on one channel.

    Args:
        channel: The channel with its labels.
        simulators: Simulators that were fitted to its `train` part, with the same coarse simulator and window, by the name of their
            residual detector.
        settings: Settings of the study; `labelled` and `seed` are used.

    Returns:
        One row for each detector.
    """
    import pandas as pd

    from enhsim_tf.detection.discord import left_discord
    from enhsim_tf.detection.registry import CONTROLS as MADE
    from enhsim_tf.detection.registry import DETECTORS
    from enhsim_tf.detection.residual_size import ResidualSize
    from enhsim_tf.enhanced_simulator.residual_detector import AlignedResidual
    from enhsim_tf.telemetry.windows import cut_windows
    from studies.spacecraft.judging import Judge, cross_fitted_scores
    from studies.spacecraft.rates import rates_of

    simulator = next(iter(simulators.values()))
    window, seed, chosen = simulator.window, settings.seed, settings.labelled
    stride = max(1, window // 8)
    period = max(wave.period_s for wave in simulator.coarse.waves) / channel.train.interval_s
    judge = Judge(channel, window, period, chosen.false_alarm_rate)
    starts = np.arange(0, len(channel.train) - window + 1, stride)
    past = cut_windows(channel.train.values, starts, window)

    for name, fitted in simulators.items():
        series = fitted.generate_series(_SERIES * window, seed=seed + 1)
        generated = cut_windows(series, np.arange(0, len(series) - window + 1, stride), window)
        aligned = AlignedResidual(fitted).fit(fitted.generate(chosen.num_arm_windows, seed=seed))
        sizes = {part: aligned.sizes(windows) for part, windows in (("test", judge.windows), ("own", generated), ("past", past))}
        for ending, bound in BOUNDS.items():
            detector = ResidualSize(bound).fit_sizes(aligned.size.typical * np.ones(1))
            judge.add("simulator", name + ending, *map(detector.score_sizes, sizes.values()))
    for name in CONTROLS:
        make = MADE.get(name) or DETECTORS[name]
        scores = cross_fitted_scores(lambda make=make: make(seed), past, starts, chosen.num_folds)
        judge.add("real", name, make(seed).fit(past).score(judge.windows), scores, scores)
    whole = np.concatenate([channel.train.values, channel.test.values])
    late = starts[starts >= len(channel.train) // 3]  # the first windows have hardly any before them
    before = left_discord(channel.train.values, late, window)
    judge.add("real", DISCORD, left_discord(whole, len(channel.train) + judge.begins, window), before, before)

    name, labels = channel.labels.channel, channel.labels
    tables = {each: pd.DataFrame(rows).assign(channel=name, seed=seed) for each, rows in judge.rows.items()}
    tables["channels"] = pd.DataFrame([{"channel": name, "window": window, "stride": stride, "samples": len(channel.test), "seed": seed}])
    tables["sequences"] = pd.DataFrame(
        [{"channel": name, "sequence": number, "start": start, "stop": stop} for number, (start, stop) in enumerate(labels.sequences)]
    )
    return _rows(tables, rates_of(tables), name)


def _rows(tables: "dict[str, pd.DataFrame]", rates: Any, name: str) -> list[dict[str, Any]]:
    from studies.spacecraft.matched import RATES

    ranking = tables["ranking"].set_index(["arm", "detector"])
    found = rates.finds[name][0]
    rows = []
    for number, cell in enumerate(rates.cells.to_dict("records")):
        finds = {f"found_at_{rate:g}": int(found[column, number].sum()) for column, rate in enumerate(RATES)}
        areas = ranking.loc[(cell["arm"], cell["detector"])]
        rows.append(
            {"seed": cell["seed"], "channel": name, "detector": cell["detector"]}
            | {"false_alarms": cell["own"], "false_alarms_past": cell["past"]}
            | finds
            | {"sequences": found.shape[2], "auc_pr": float(areas["auc_pr"]), "vus_pr": float(areas["vus_pr"])}
        )
    return rows


def summarise(table: "pd.DataFrame") -> "pd.DataFrame":
    """Returns one row for each detector: false alarms, finds and areas over channels, mean over seeds.

    Args:
        table: The table that `run` writes.
    """
    import pandas as pd

    rows = []
    areas = table.pivot_table(index="channel", columns="detector", values="auc_pr")
    lines = areas[[name for name in ONE_LINE if name in areas]].max(axis=1)
    for name, some in table.groupby("detector", sort=False):
        by_seed = some.groupby("seed")
        finds = {column: float(by_seed[column].sum().mean()) for column in some.columns if column.startswith("found_at")}
        rows.append(
            {
                "detector": name,
                "median_false_alarms": float(some.groupby("channel")["false_alarms"].mean().median()),
                "mean_false_alarms": float(some["false_alarms"].mean()),
                **finds,
                "sequences": float(by_seed["sequences"].sum().mean()),
                "auc_pr": float(some["auc_pr"].mean()),
                "channels": len(areas),
                "channels_ahead": int((areas[name] > lines).sum()),
                "vus_pr": float(some["vus_pr"].mean()),
            }
        )
    return pd.DataFrame(rows)


def residual_table(rows: "Mapping[str, Mapping[str, Any]]") -> str:
    """Returns the rows of `summarise` as a Markdown table.

    Args:
        rows: Rows by the name of the detector; empty if the detector has not been tried.
    """
    if not rows:
        return "This has not been measured yet."
    lines = [
        "| detector | false alarms, median channel | mean | found at 1 % | at 5 % | at 10 % | AUC-PR | channels ahead |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, row in sorted(rows.items(), key=lambda item: -item[1]["auc_pr"]):
        finds = " | ".join(f"{row[f'found_at_{rate}']:.2g}" for rate in (0.01, 0.05, 0.1))
        ahead = "" if name in ONE_LINE else f"{row['channels_ahead']} of {row['channels']}"
        lines.append(
            f"| {name} | {row['median_false_alarms']:.1%} | {row['mean_false_alarms']:.1%} | {finds} | {row['auc_pr']:.2f} | {ahead} |"
        )
    number = next(iter(rows.values()))["sequences"]
    return "\n".join(
        [
            *lines,
            "",
            f"Found are labelled sequences, of {number:g}, means over three training seeds. Channels ahead are those whose AUC-PR exceeds that of the "
            f"{' and the '.join(ONE_LINE)}. From `figures/labelled/{TABLE}`.",
        ]
    )


def saved_simulator(folder: Path, channel: str, seed: int) -> "Path | None":
    """Finds the latest simulator of a channel and a seed among the cached fits of the study.

    Args:
        folder: Cache of the study.
        channel: Name of the channel.
        seed: Seed of the training.
    """
    found = []
    for path in folder.glob(f"fit {channel}-*/simulator/settings.json"):
        if json.loads(path.read_text(encoding="utf-8")).get("trained", {}).get("seed") == seed:
            found.append(path)
    return max(found, key=lambda path: path.stat().st_mtime).parent if found else None


def run(
    settings: Settings,
    fits: Path,
    cache: Path,
    data: Path,
    out: Path,
    channels: Sequence[str] | None,
    seeds: Sequence[int],
    tell: Callable[[str], None],
) -> "pd.DataFrame":
    """Judges the detectors on all channels and seeds, and writes the table after each of them.

    Args:
        settings: All settings.
        fits: Cache of the study, from which fitted simulators are read.
        cache: Cache into which simulators that are missing are fitted.
        data: Folder of the data set.
        out: Folder of the table.
        channels: Names of the channels; None for all.
        seeds: Training seeds.
        tell: Called with a line about each channel.
    """
    import pandas as pd

    from enhsim_tf.common.stages import Stages
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from studies.spacecraft.study import ChannelStudy

    path, rows = make_folder(out) / TABLE, []
    for seed in seeds:
        for name in channels or read_labels(data):
            channel, chosen = load_channel(data, name), dataclasses.replace(settings, seed=seed)
            try:
                saved = saved_simulator(fits, name, seed)
                simulator = EnhancedSimulator.load(saved) if saved else ChannelStudy(channel, chosen, Stages(cache, False, tell)).simulator
                rows += judge_channel(channel, {NETWORK: simulator, RIDGE: ridge_simulator(channel, chosen)}, chosen)
            except InputError as error:
                tell(f"{name}, seed {seed}: left out: {error}")
                continue
            last = {row["detector"]: row for row in rows[-len(RESIDUALS) - len(CONTROLS) - 1 :]}
            said = ", ".join(f"{each} {row['false_alarms']:.1%} / {row['auc_pr']:.2f}" for each, row in last.items())
            tell(f"{name}, seed {seed}: false alarms / AUC-PR: {said}")
            with replace_file(path) as temporary:
                pd.DataFrame(rows).round(5).to_csv(temporary, index=False)
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and returns its exit code.

    Args:
        arguments: Arguments of the command. None uses those of the process.
    """
    return run_command(lambda: _run(arguments), "interrupted; the finished channels are in the table")


def _run(arguments: list[str] | None) -> int:
    parser = Parser(
        prog="python -m studies.spacecraft.residual",
        description="Compares the residual detector with one-line controls and left discord on labelled telemetry.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="folder with train/, test/ and labeled_anomalies.csv")
    parser.add_argument(
        "--cache", type=Path, default=Path(".cache"), metavar="DIR", help="cache for simulators that are fitted (default: .cache)"
    )
    parser.add_argument(
        "--fits", type=Path, metavar="DIR", help="cache of the study, from which fitted simulators are read (default: --cache)"
    )
    parser.add_argument("--out", type=Path, default=Path("figures/labelled"), metavar="DIR", help="folder of the table")
    parser.add_argument("--channels", metavar="A,B", help="only these channels")
    parser.add_argument("--seeds", default="0,1,2", metavar="A,B", help="training seeds (default: 0,1,2)")
    options = parser.parse_args(arguments)
    try:
        seeds = [int(seed) for seed in options.seeds.split(",")]
    except ValueError:
        raise InputError(f"Expected seeds as whole numbers with commas. Received: --seeds {options.seeds}.") from None
    chosen = options.channels.split(",") if options.channels else None
    table = run(make_settings("full"), options.fits or options.cache, options.cache, options.data, options.out, chosen, seeds, tell)
    if not len(table):
        raise InputError(f"Expected a channel that can be used. Received: none in {options.data}. The lines above say why.")
    tell(summarise(table).to_string(index=False, float_format=lambda number: f"{number:.3f}"))
    tell(f"table in {options.out / TABLE}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
