"""The findings of the study: every number of its page and figure, computed from its table.

Series are the replicates. The setting of a method on a series is that with the largest mean AUC-PR
on the other development series of its data set.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.common.command import PUBLISHED
from studies.common.statistics import holm, paired_difference, t_interval
from studies.common.tables import KeptTables, seeds_of
from studies.public_benchmarks.arms import CHOSEN, DIFFERENCE, GENERATED, TELEMETRY
from studies.public_benchmarks.onsets import GROUPS
from studies.public_benchmarks.peers import PEERS

if TYPE_CHECKING:
    import pandas as pd

KEPT = KeptTables(
    ("scores", "onsets"),
    labels=("series", "data_set", "method", "setting", "kind"),
    digits=5,
    command="python -m studies.public_benchmarks --data FOLDER ...",
)
CONTRASTS = {
    "uses": ((DIFFERENCE, TELEMETRY), (GENERATED, TELEMETRY), (DIFFERENCE, GENERATED)),
    "peers": tuple((CHOSEN, peer) for peer in PEERS),
}
"""Pairs of methods whose AUC-PR are compared, by the question that they answer, within which
p-values are adjusted.
"""
MANY = 0.1
"""Share of nominal time that is flagged on a series which has left its operating point."""


def summarise(tables: "Mapping[str, pd.DataFrame]") -> dict[str, Any]:
    """All numbers of the study.

    Args:
        tables: The tables `scores` and `onsets`.

    Returns:
        For the development series of each data set, and for its others: their number, the results
        of `methods`, and for each of `CONTRASTS` the paired differences in AUC-PR. The settings
        that all development series choose, by data set and peer. And `onsets`: for injected
        anomalies of each group and data set, and for each example, how many are found, and the
        errors of their onsets and delays in samples.
    """
    rows = tables["scores"]
    judged = _with_chosen_settings(rows)
    groups = {}
    for (data_set, is_development), group in judged.groupby(
        ["data_set", "is_development"], sort=False
    ):
        kind = "development" if is_development else "others"
        groups[f"{data_set}, {kind}"] = {
            "series": int(group["series"].nunique()),
            "methods": {name: _results(each) for name, each in group.groupby("method", sort=False)},
            "contrasts": {
                question: _contrasts(group, pairs) for question, pairs in CONTRASTS.items()
            },
        }
    development = rows[rows["is_development"]]
    return {
        "groups": groups,
        "settings": {
            data_set: {name: _best(tried) for name, tried in each.groupby("method", sort=False)}
            for data_set, each in development.groupby("data_set", sort=False)
        },
        "onsets": _onsets(tables["onsets"]),
        "seeds": seeds_of(rows),
    }


def _onsets(rows: "pd.DataFrame") -> dict[str, Any]:
    """How well onsets are told, by data set and group of anomalies, or example."""
    groups = rows["kind"].map(lambda kind: GROUPS.get(kind, kind))
    found: dict[str, Any] = {}
    for (data_set, group), chosen in rows.groupby(["data_set", groups], sort=False):
        told = chosen.dropna(subset=["onset_error"])
        found.setdefault(data_set, {})[group] = {
            "number": len(chosen),
            "found": len(told) / len(chosen),
            "onset_error": _median(told["onset_error"]),
            "onset_error_of_90": None if told.empty else float(told["onset_error"].quantile(0.9)),
            "delay": _median(told["delay"]),
        }
    return found


def _with_chosen_settings(rows: "pd.DataFrame") -> "pd.DataFrame":
    """The rows of each series with the settings that the other development series choose; those of
    the published table where there are none.
    """
    import pandas as pd

    chosen = []
    for (data_set, method, series), tried in rows.groupby(
        ["data_set", "method", "series"], sort=False
    ):
        if tried["setting"].nunique() > 1:
            others = _others(rows, data_set, method, series)
            if others.empty:
                published = KEPT.read(PUBLISHED / "public_benchmarks" / "results")["scores"]
                others = _others(published, data_set, method, series)
            tried = tried[tried["setting"] == _best(others)]
        chosen.append(tried)
    return pd.concat(chosen)


def _others(rows: "pd.DataFrame", data_set: str, method: str, series: str) -> "pd.DataFrame":
    """The rows of the development series but one."""
    is_asked = (rows["data_set"] == data_set) & (rows["method"] == method)
    return rows[is_asked & rows["is_development"] & (rows["series"] != series)]


def _best(tried: "pd.DataFrame") -> str:
    """The setting with the largest mean AUC-PR, the first of equal ones."""
    return str(tried.groupby("setting", sort=False)["auc_pr"].mean().idxmax())


def _by_series(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Means over seeds."""
    return rows.drop(columns=["data_set", "method", "setting"]).groupby("series", sort=False).mean()


def _results(rows: "pd.DataFrame") -> dict[str, Any]:
    """Results of one method: AUC-PR with its interval over series; found events as shares of all;
    medians of the others over series.
    """
    means = _by_series(rows)
    counts = [name for name in means.columns if name.startswith("found")]
    middle = ("false_alarms", "onset_error", "delay", "cpu_s")
    return {
        "auc_pr": t_interval(means["auc_pr"]),
        **{name: float(means[name].sum() / means["events"].sum()) for name in counts},
        **{name: _median(means[name]) for name in middle},
        "many_false_alarms": float((means["false_alarms"] > MANY).mean()),
    }


def _median(values: "pd.Series") -> float | None:
    """The median of the values that are there, None without any."""
    return None if values.isna().all() else float(values.median())


def _contrasts(group: "pd.DataFrame", pairs: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    areas = {name: _by_series(rows)["auc_pr"] for name, rows in group.groupby("method")}
    found = {
        f"{first} - {second}": paired_difference(areas[first], areas[second])
        for first, second in pairs
        if {first, second} <= set(areas)
    }
    adjusted = holm({name: each["p"] for name, each in found.items()})
    return {name: each | {"p_holm": adjusted[name]} for name, each in found.items()}
