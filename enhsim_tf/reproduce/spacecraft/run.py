"""`python -m enhsim_tf.reproduce --experiment labelled --data FOLDER`: runs all channels and writes tables, findings, figures and the report."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.number_words import in_words
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.reproduce.replicates import collect, seed_by_seed, write_results
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import Stages
from enhsim_tf.telemetry.telemanom import load_channel, read_labels

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "labelled"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, data: Path, out: Path, channels: Sequence[str] | None, fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the study and writes its results; channels that were finished with a seed are read from the cache.

    Args:
        settings: All settings.
        cache: Folder of cached stages.
        data: Folder with `train/`, `test/` and `labeled_anomalies.csv`.
        out: Output folder for tables, findings and figures.
        channels: Names of the channels; None for all in the folder.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.

    Returns:
        The findings.

    Raises:
        InputError: If the folder does not have this layout, a channel is missing, or no channel can be used.
    """
    labels = read_labels(data)
    unknown = [name for name in channels or () if name not in labels]
    if unknown:
        raise InputError(f"Expected --channels of {', '.join(list(labels)[:8])}. Received: {unknown[0]!r}. Name labelled ones.")
    from enhsim_tf.reproduce.spacecraft.figures import FIGURES
    from enhsim_tf.reproduce.spacecraft.findings import KEPT, summarise
    from enhsim_tf.reproduce.spacecraft.study import ChannelStudy

    make_folder(out)
    skipped: dict[str, str] = {}

    def tables_of(name: str, seed: int, stages: Stages) -> "dict[str, pd.DataFrame]":
        try:
            return ChannelStudy(load_channel(data, name), dataclasses.replace(settings, seed=seed), stages, int(sys.stdout.isatty())).tables
        except InputError as error:  # a channel that cannot be used
            skipped[name] = str(error)
            tell(f"left out: {error}")
            return {}

    chosen = list(channels or labels)
    seeds = range(settings.seed, settings.seed + settings.labelled.num_seeds)
    tables = collect("channel", seed_by_seed(tables_of, chosen, seeds), cache, fresh, tell)
    if not tables:
        raise InputError(f"Expected a channel that can be used. Received: none of {len(chosen)} in {data}. The first: {skipped[chosen[0]]}")
    return write_results(tables, KEPT, summarise, FIGURES, out, {"budget": settings.budget, "skipped": skipped})


def table(found: dict[str, Any]) -> str:
    """The tables of the page on the spacecraft: one row per training arm and control, and one row per channel."""
    from enhsim_tf.reproduce.publish.wording import p_value
    from enhsim_tf.reproduce.spacecraft.rates import PRIMARY
    from enhsim_tf.reproduce.spacecraft.study import DEGRADED_ARM, GENERATED_ARM, RIDGE_ARM

    rows = [
        "| trained on | false alarms, own threshold | threshold on its past | found at 1 % false alarms | at 5 % | at 10 % | by chance at 5 % | p | AUC-PR |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    arms = {name: about for name, about in found["arms"].items() if name != DEGRADED_ARM}
    for name, about in (arms | {f"*one line: {name}*": about for name, about in found["controls"].items()}).items():
        primary = next(each for each in about["matched"] if each["rate"] == PRIMARY)
        cells = [_percent(about["false_alarms"]["mean"]) + _range(about["false_alarms"]), _percent(about["false_alarms_past"]["mean"])]
        cells += [_percent(each["mean"]) + _range(each) * (each is primary) for each in about["matched"]]
        cells += [_percent(primary["chance"]), p_value(primary["p_value"]), f"{about['auc_pr']:.2f}"]
        rows.append(f"| {name} | {' | '.join(cells)} |")
    rows += [
        "",
        "| channel | NRMSE coarse | ridge | ridge, own clock | nearest windows | enhanced | false alarms, trained on its past | on generated | on ridge + residual windows | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, about in found["channels"].items():
        cells = [f"{about['nrmse'][method]:.3f}" for method in ("coarse", "ridge", "ridge, own clock", "nearest windows", "enhanced")]
        cells += [
            _percent(about["false_alarms_by_arm"][arm]) if arm in about["false_alarms_by_arm"] else "-"
            for arm in ("real", GENERATED_ARM, RIDGE_ARM)
        ]
        rows.append(f"| {name} | {' | '.join(cells)} | {'told apart' if about['told_apart'] else ''} |")
    shown = {"its past": "real", "generated": GENERATED_ARM, "ridge + residual windows": RIDGE_ARM}
    shown = {name: arms[arm]["by_detector"] for name, arm in shown.items() if arm in arms}
    rows += ["", f"| detector | {' | '.join(f'false alarms, trained on {name} | found at 1 %' for name in shown)} |"]
    rows.append(f"|---|{'---|---|' * len(shown)}")
    for detector in shown["its past"]:
        cells = [cell for about in shown.values() for cell in map(_percent, _alarms_and_finds(about[detector]))]
        rows.append(f"| {detector} | {' | '.join(cells)} |")
    num_windows = [about["num_train_windows"] for about in found["channels"].values()]
    return "\n".join(rows) + (
        f"\n\nFalse alarms and finds are means over {in_words(len(DETECTORS))} detectors (one for each of the last rows), {in_words(len(found['channels']))} channels with "
        f"{in_words(found['num_sequences'])} labelled sequences, and {in_words(len(found['seeds']))} training "
        f"seed{'s' * (len(found['seeds']) > 1)}. Every arm learns from all of the *train* part. The *own "
        "threshold* is set for 1 % on held-out windows of the arm: other generated windows, or windows of the *train* part from blocks of time that the detector did not "
        f"learn from. The *train* part has {min(num_windows)} to {max(num_windows)} windows that share no sample, too few for a reliable threshold of 1 %. *Found at 5 % false "
        "alarms* is the share of the sequences found when each threshold is set such that 5 % of the nominal test windows are above it, so that all rows can be compared; "
        "*by chance* is what the same scores find when the labels are shifted around the circle of the test record, and *p* the probability that chance finds as many. "
        "*NRMSE* is the median over nominal test windows, after phase, offset and gain are aligned to each window; *ridge* is aligned by the edges of the square wave, and "
        "*ridge, own clock* by its own waveform, as the enhanced signal is; *nearest windows* is the mean of the nearest training windows, aligned as "
        f"the latter. {_lowest(found)} A channel is *told apart* if detectors alarm on more than half of its nominal windows for the "
        "median noisy arm. There, false alarms do not compare arms: either the channel has changed, or its *train* part is too short for a threshold of 1 %, "
        "which this study cannot tell apart. "
        "The last table has the means of each detector over the channels. From `figures/labelled/findings.json`."
    )


def _range(about: dict[str, float]) -> str:
    return f" ({100 * about['low']:.0f} to {100 * about['high']:.0f})"


def _alarms_and_finds(about: dict[str, Any]) -> tuple[float, float]:
    return about["false_alarms"], about["found_by_rate"][0]


def _lowest(found: dict[str, Any]) -> str:
    """On how many channels the enhanced signal has a larger error than each method without a network."""
    errors = [about["nrmse"] for about in found["channels"].values()]
    counts = {name: sum(each[name] < each["enhanced"] for each in errors) for name in ("ridge, own clock", "nearest windows")}
    said = " and ".join(f"that of *{name}* on {count} of {len(errors)}" for name, count in counts.items())
    return f"The error of the enhanced signal is above {said} channels."


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def lines(found: dict[str, Any]) -> list[str]:
    """The last lines that the command prints."""
    from enhsim_tf.reproduce.spacecraft.study import GENERATED_ARM

    said = []
    for name, about in found["channels"].items():
        error, alarms = about["nrmse"], about["false_alarms_by_arm"]
        said.append(
            f"{name:6} NRMSE {error['enhanced']:.2f} (coarse {error['coarse']:.2f}, ridge {error['ridge, own clock']:.2f}); false alarms trained on generated telemetry "
            f"{alarms.get(GENERATED_ARM, float('nan')):.1%}, on real {alarms['real']:.1%}{'; told apart' if about['told_apart'] else ''}"
        )
    said += [
        f"{name:6} left out for one seed or more: {reason}"
        for name, about in found["channels"].items()
        for reason in about.get("dropped", ())
    ]
    for name, about in (found["arms"] | found["controls"]).items():
        matched = ", ".join(f"{each['mean']:.0%} at {each['rate']:.0%}" for each in about["matched"])
        said.append(f"{name:26} false alarms {about['false_alarms']['mean']:6.1%}; sequences found {matched} false alarms")
    return said
