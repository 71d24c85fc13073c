"""`python -m enhsim_tf.reproduce --experiment labelled --data FOLDER`: runs all channels and writes tables, findings, figures and the report."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.atomic_files import make_folder, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.number_words import in_words
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import VERSIONS, Stages, Turns
from enhsim_tf.telemetry.telemanom import load_channel, read_labels

if TYPE_CHECKING:
    import pandas as pd

FOLDER = "labelled"  # below the folder of the figures


def run(
    settings: Settings, cache: Path, data: Path, out: Path, channels: Sequence[str] | None, fresh: bool, tell: Callable[[str], None]
) -> dict[str, Any]:
    """Runs the study and writes its results; finished channels are read from the cache.

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
    from enhsim_tf.reproduce.figure import save_all
    from enhsim_tf.reproduce.spacecraft.figures import FIGURES
    from enhsim_tf.reproduce.spacecraft.findings import KEPT, summarise

    folder = make_folder(out)
    tables, skipped = collect(settings, cache, data, channels, fresh, tell)
    KEPT.write(tables, folder)
    found = summarise(KEPT.read(folder))
    found |= {"budget": settings.budget, "skipped": skipped, "versions": VERSIONS}
    write_json(folder / "findings.json", found)
    save_all(FIGURES, found, folder, KEPT.command)
    return found


def collect(
    settings: Settings, cache: Path, data: Path, channels: Sequence[str] | None, fresh: bool, tell: Callable[[str], None]
) -> "tuple[dict[str, pd.DataFrame], dict[str, str]]":
    """The tables of all channels, and the reason for each channel that could not be used.

    Args:
        settings: All settings.
        cache: Folder of cached stages.
        data: Folder of the data set.
        channels: Names of the channels; None for all.
        fresh: Whether to run every stage again instead of using the cache.
        tell: Called with a line about each stage.
    """
    import pandas as pd

    from enhsim_tf.reproduce.spacecraft.study import ChannelStudy

    labels = read_labels(data)
    unknown = [name for name in channels or () if name not in labels]
    if unknown:
        raise InputError(f"Expected --channels of {', '.join(list(labels)[:8])}. Received: {unknown[0]!r}. Name labelled ones.")
    parts: dict[str, list[pd.DataFrame]] = {}
    skipped: dict[str, str] = {}
    chosen, is_terminal = list(channels or labels), sys.stdout.isatty()
    turns = Turns("channel", len(chosen), tell)
    for name in chosen:
        turns.begin(name)
        stages = Stages(cache, fresh, tell, speaks=not is_terminal)
        try:
            study = ChannelStudy(load_channel(data, name), settings, stages, int(is_terminal))
            tables = study.tables
        except InputError as error:
            skipped[name] = str(error)
            tell(f"left out: {error}")
            turns.end(stages)
            continue
        for each, table in tables.items():
            parts.setdefault(each, []).append(table)
        turns.end(stages)
        from enhsim_tf.keras_tools.backend import keras

        keras.backend.clear_session()  # frees the memory of the channel's networks
    if not parts:
        raise InputError(f"Expected a channel that can be used. Received: none of {len(chosen)} in {data}. The first: {skipped[chosen[0]]}")
    return {name: pd.concat(each, ignore_index=True) for name, each in parts.items()}, skipped


def table(found: dict[str, Any]) -> str:
    """The table of the README, one row per channel."""
    from enhsim_tf.reproduce.spacecraft.study import GENERATED_ARM

    rows = [
        "| channel | NRMSE coarse | ridge | ridge, same clock | enhanced | false alarms, trained on its past | on generated | sequences found, past | generated |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, about in found["channels"].items():
        error = about["nrmse"]
        cells = [f"{error[method]:.3f}" for method in ("coarse", "ridge", "ridge, same clock", "enhanced")]
        cells += [
            f"{100 * sum(rates.values()) / len(rates):.0f} %" for rates in (about["false_alarms"][arm] for arm in ("real", GENERATED_ARM))
        ]
        for arm in ("real", GENERATED_ARM):
            finds = [is_found for sequence in about["sequences"] for is_found in sequence["found"][arm].values()]
            cells.append(f"{100 * sum(finds) / len(finds):.0f} %")
        rows.append(f"| {name} | {' | '.join(cells)} |")
    pairs = found["pairs"]
    return "\n".join(rows) + (
        "\n\n*NRMSE* is the median over nominal test windows, after phase, offset and gain are aligned to each window. *Ridge, same clock* is aligned with "
        f"the phase that the enhanced signal finds. False alarms and sequences found are means over {in_words(len(DETECTORS))} detectors whose thresholds are set for 1 %, with "
        f"{found['num_sequences']} labelled sequences and one training seed. In {pairs['saturated']} of {pairs['number']} pairs of channel and detector, the detectors "
        f"of both trainings alarm on more than {100 * pairs['above']:.0f} % of nominal windows. From `figures/labelled/findings.json`."
    )


def lines(found: dict[str, Any]) -> list[str]:
    """The last lines that the command prints."""
    from enhsim_tf.reproduce.spacecraft.study import GENERATED_ARM

    said = []
    for name, about in found["channels"].items():
        error = about["nrmse"]
        caught = sum(bool(found["bars"]["found"][name][number]) for number in range(len(about["sequences"])))
        said.append(
            f"{name:6} NRMSE {error['enhanced']:.2f} (coarse {error['coarse']:.2f}, ridge {error['ridge']:.2f}); false alarms "
            f"{about['median_ratio']:.2f} times the real-trained ones (median detector); {caught} of {len(about['sequences'])} sequences found"
        )
    arms = found["arms"]
    said.append(
        f"all    false alarms trained on generated telemetry {arms[GENERATED_ARM]['false_alarms']['mean']:.1%}, on real {arms['real']['false_alarms']['mean']:.1%}; "
        f"sequences found {arms[GENERATED_ARM]['found']['mean']:.0%} and {arms['real']['found']['mean']:.0%} (mean over detectors)"
    )
    return said
