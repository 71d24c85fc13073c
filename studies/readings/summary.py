"""From the table of measurements to verdicts over readings, seeds and roundings, and to what the command compares its runs with.

A claim has the verdict of at least 80 % of the reference's runs if most readings that touch the claim have it, too. Otherwise it is
undecided, and the readings that differ are named. Verdicts are computed from the measurements, so that a limit can change without a run.
"""

import collections
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.paper.claims import CLAIMS, NOT_REPRODUCED, OF_UNTESTED, PARTLY, REPRODUCED, verdict
from enhsim_tf.paper.report import UNDECIDED
from enhsim_tf.paper.settings import make_settings
from studies.readings.run import KEYS, READINGS

SHARE = 0.8
TOUCHED_BY = {
    "C1": {"windows", "enhancer"},
    "C2": set(),
    "C3": {"windows", "enhancer"},
    "C4": {"windows", "noise", "noise GAN"},
    "C5": {"windows", "noise", "noise GAN"},
    "C6": {"windows", "noise", "noise GAN"},
    "C7": {"windows", "enhancer", "noise", "noise GAN"},
    "C8": {"windows", "enhancer", "noise", "noise GAN"},
    "C9": {"windows", "enhancer"},
}
"""The stages on which the measurements of each claim depend."""


def touches(reading: str, claim: str) -> bool:
    """Whether a reading changes something on which a claim depends. C4 is measured on the reference alone."""
    if reading == "reference":
        return True
    changed = make_settings(**READINGS[reading])
    return claim != "C4" and any(
        changed.of(stage) != make_settings().of(stage) for stage in TOUCHED_BY[claim]
    )


def verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """The verdict on each claim in each run.

    Args:
        table: The table of `run.collect`.

    Returns:
        Columns `reading`, `rounding`, `seed`, `claim` and `verdict`, without claims that were not measured.
    """
    limits = {claim.id: claim.limits for claim in CLAIMS}
    rows = []
    for (*run, claim), part in table.groupby([*KEYS, "claim"], sort=False):
        rows.append(
            (
                *run,
                claim,
                verdict(limits[claim], dict(zip(part["name"], part["value"], strict=True))),
            )
        )
    return pd.DataFrame(rows, columns=[*KEYS, "claim", "verdict"])


def decide(found: pd.DataFrame, claim: str) -> dict[str, Any]:
    """The published verdict on one claim.

    Args:
        found: The result of `verdicts`.
        claim: Its id.

    Returns:
        `verdict`; `runs`, the numbers of runs of the reference in which the claim is reproduced, partly reproduced and not; and
        `decided_by`, the readings that differ if it is undecided, or None.
    """
    of_claim = found[found["claim"] == claim]
    counts = {
        reading: collections.Counter(part["verdict"])
        for reading, part in of_claim.groupby("reading", sort=False)
    }
    of_reading = {
        reading: count.most_common(1)[0][0]
        for reading, count in counts.items()
        if touches(reading, claim)
    }
    common, agreeing = counts["reference"].most_common(1)[0]
    total = counts["reference"].total()
    others = {reading: each for reading, each in of_reading.items() if reading != "reference"}
    differing = [reading for reading, each in others.items() if each != common]
    is_decided = agreeing >= SHARE * total and 2 * len(differing) < max(len(others), 1)
    causes = differing if agreeing >= SHARE * total else ["seed", *differing]
    return {
        "verdict": common if is_decided else UNDECIDED,
        "runs": [counts["reference"][each] for each in (REPRODUCED, PARTLY, NOT_REPRODUCED)],
        "decided_by": None if is_decided else ", ".join(causes),
    }


def publish(table: pd.DataFrame) -> dict[str, Any]:
    """The content of `enhsim_tf/paper/published.json`; see `enhsim_tf.paper.report.read_published`."""
    found, claims = verdicts(table), {}
    reference = table[table["reading"] == "reference"]
    for claim in CLAIMS:
        decided = decide(found, claim.id)
        if not claim.is_tested:
            decided["verdict"] = OF_UNTESTED.get(decided["verdict"], decided["verdict"])
        values = reference[reference["claim"] == claim.id].groupby("name")["value"]
        low, high = values.min(), values.max()
        ranges = {
            name: [float(low[name]), float(high[name])]
            for name in dict.fromkeys(limit.name for limit in claim.limits)
        }
        claims[claim.id] = decided | {"ranges": ranges}
    tested = [claims[claim.id]["verdict"] for claim in CLAIMS if claim.is_tested]
    sign = (
        "[¬Re]"
        if NOT_REPRODUCED in tested
        else "[Re]"
        if set(tested) == {REPRODUCED}
        else "[Re, in part]"
    )
    seeds, roundings, readings = (
        reference["seed"].nunique(),
        reference["rounding"].nunique(),
        table["reading"].nunique(),
    )
    return {
        "title": sign,
        "basis": f"seeds of the reference: {seeds}, roundings: {roundings}; readings: {readings}",
        "claims": claims,
    }


def most_common(found: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """The table of the README: for each reading its number of runs, and on each claim the most common verdict with its share of the runs.

    Args:
        found: The result of `verdicts`.

    Returns:
        Header and rows.
    """
    claims = [claim.id for claim in CLAIMS]
    rows = []
    for reading, runs in found.groupby("reading", sort=False):
        row = [reading, str(len(runs[["rounding", "seed"]].drop_duplicates()))]
        for claim in claims:
            given = collections.Counter(runs.loc[runs["claim"] == claim, "verdict"])
            verdict, number = given.most_common(1)[0] if given else ("", 0)
            row.append(
                f"{verdict} {number}/{given.total()}" if given and touches(reading, claim) else ""
            )
        rows.append(row)
    return ["reading", "runs", *claims], rows


def shares(found: pd.DataFrame) -> pd.DataFrame:
    """The share of runs with each verdict, by reading, claim and verdict, for the figure and the table of the README."""
    is_touched = np.array(
        [
            touches(reading, claim)
            for reading, claim in zip(found["reading"], found["claim"], strict=True)
        ],
        bool,
    )
    counts = (
        found[is_touched]
        .groupby(["reading", "claim"], sort=False)["verdict"]
        .value_counts(normalize=True)
    )
    return counts.rename("share").reset_index()
