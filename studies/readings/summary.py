"""From the table of measurements to verdicts over readings, seeds and roundings, and to what the
command compares its runs with.

Three readings decide: the base, the author's configuration, and the former base. A claim has the
verdict of at least 80 % of the runs of each that has at least five, with all limits as they are, at
half and at twice their distances from the ideal. Otherwise it is undecided, and what turns it is
named. Verdicts are computed from the measurements, so that a limit
can change without a run.
"""

import collections
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.paper.claims import (
    CLAIMS,
    NOT_REPRODUCED,
    OF_UNTESTED,
    PARTLY,
    REPRODUCED,
    SHOWN,
    Claim,
    Limit,
    title,
    verdict,
)
from enhsim_tf.paper.report import UNDECIDED
from enhsim_tf.paper.settings import make_settings
from studies.readings.run import (
    AUTHOR,
    BASE,
    DECIDING,
    FACTORIAL,
    FACTORS,
    FORMER,
    KEYS,
    READINGS,
)

SHARE = 0.8
FEWEST = 5
HALVED = 0.5
AS_FIXED = 1.0
DOUBLED = 2.0
VERDICTS = (REPRODUCED, PARTLY, NOT_REPRODUCED)
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
    """Whether a reading changes something on which a claim depends. C4 is measured on the columns
    alone.
    """
    if reading in DECIDING:
        return True
    changed = make_settings(**READINGS[reading])
    return claim != "C4" and any(
        changed.of(stage) != make_settings().of(stage) for stage in TOUCHED_BY[claim]
    )


def measurements(table: pd.DataFrame, claim: str) -> pd.DataFrame:
    """The measurements of a claim: one row for each run, one column for each name.

    Args:
        table: The table of `run.collect`.
        claim: The claim's id.
    """
    return table[table["claim"] == claim].pivot(index=KEYS, columns="name", values="value")


def verdicts(
    table: pd.DataFrame, factors: Sequence[float] = (AS_FIXED,), claims: Sequence[Claim] = CLAIMS
) -> pd.DataFrame:
    """The verdict on each claim in each run.

    Args:
        table: The table of `run.collect`.
        factors: By which the distance of each limit from its ideal is multiplied.
        claims: The claims with their limits.

    Returns:
        Columns `reading`, `rounding`, `seed`, `claim`, `factor` and `verdict`, without claims that
        were not measured.
    """
    rows = [
        (*run, claim.id, factor, verdict(claim.limits, measured, factor))
        for claim in claims
        for run, measured in measurements(table, claim.id).to_dict("index").items()
        for factor in factors
    ]
    return pd.DataFrame(rows, columns=[*KEYS, "claim", "factor", "verdict"])


def num_runs(table: pd.DataFrame, reading: str) -> int:
    """The number of runs of a reading."""
    return len(table.loc[table["reading"] == reading, KEYS].drop_duplicates())


def counts(found: pd.DataFrame, reading: str, claim: str) -> collections.Counter:
    """How many runs of a reading have each verdict on a claim."""
    chosen = (found["reading"] == reading) & (found["claim"] == claim)
    return collections.Counter(found.loc[chosen, "verdict"])


def agreed(given: collections.Counter) -> str:
    """The verdict of at least `SHARE` of the runs, or `UNDECIDED`."""
    for common, number in given.most_common(1):
        if number >= SHARE * given.total():
            return common
    return UNDECIDED


def decide(table: pd.DataFrame, claim: Claim) -> dict[str, Any]:
    """The published verdict on one claim.

    Args:
        table: The table of `run.collect`.
        claim: The claim.

    Returns:
        `verdict`; `runs`, the numbers of runs in which the claim is reproduced, partly reproduced
        and not; `by_reading`, the same for each deciding reading; and `decided_by`, what turns an
        undecided claim, or None.
    """
    factors = {HALVED: "limits halved", AS_FIXED: "", DOUBLED: "limits doubled"}
    found = verdicts(table, list(factors), [claim])
    of_factor = {factor: found[found["factor"] == factor] for factor in factors}
    of_column = {name: counts(of_factor[AS_FIXED], name, claim.id) for name in DECIDING}
    given = {
        (column, factor): agreed(counts(found, column, claim.id))
        for factor, found in of_factor.items()
        for column in DECIDING
        if of_column[column].total() >= FEWEST
    }
    as_fixed = {column: found for (column, factor), found in given.items() if factor == AS_FIXED}
    (common, _), *_ = [*collections.Counter(as_fixed.values()).most_common(1), (UNDECIDED, 0)]
    causes = ["seed"] if UNDECIDED in as_fixed.values() else []
    if not given:
        causes = ["too few runs"]
    elif not causes:
        causes = [column for column, found in as_fixed.items() if found != common]
    causes += [
        words
        for factor, words in factors.items()
        if any(given[column, factor] != found for column, found in as_fixed.items())
    ]
    return {
        "verdict": UNDECIDED if causes else common,
        "runs": [sum(count[each] for count in of_column.values()) for each in VERDICTS],
        "by_reading": {
            name: [count[each] for each in VERDICTS] for name, count in of_column.items()
        },
        "decided_by": ", ".join(causes) or None,
    }


def publish(table: pd.DataFrame) -> dict[str, Any]:
    """The content of `enhsim_tf/paper/published.json`; see
    `enhsim_tf.paper.report.read_published`.
    """
    decisive = table[table["reading"].isin(DECIDING)]
    claims = {}
    for claim in CLAIMS:
        decided = decide(table, claim)
        if not claim.is_tested:
            decided["verdict"] = OF_UNTESTED.get(decided["verdict"], decided["verdict"])
        names = dict.fromkeys(limit.name for limit in claim.limits)
        values = measurements(decisive, claim.id).reindex(columns=names)
        ranges = {
            name: [float(values[name].min()), float(values[name].max())]
            for name in names
            if values[name].count() >= FEWEST
        }
        claims[claim.id] = decided | {"ranges": ranges}
    done = {name: num_runs(table, name) for name in DECIDING}
    return {
        "title": title([claims[claim.id]["verdict"] for claim in CLAIMS if claim.is_tested]),
        "basis": f"{done[BASE]} runs of the base, {done[AUTHOR]} of the author's configuration, "
        f"{done[FORMER]} of the former base",
        "claims": claims,
    }


def signs(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """On what the title depends: with each statistic of C6 in place of the AUC, and by column, in
    how many runs C6 holds with limits halved, as they are, and doubled, and the signs that follow.

    Returns:
        Header and rows.
    """
    sixth = next(claim for claim in CLAIMS if claim.id == "C6")
    shown = [limit for limit in sixth.limits if limit.decides == SHOWN]
    ways: dict[str, tuple[Limit, ...]] = {"AUC over its floor": sixth.limits}
    ways |= {limit.words: (basic(limit),) for limit in shown}
    ways["all of these but the AUC and the rank"] = tuple(map(basic, shown[:-1]))
    columns = [column for column in DECIDING if num_runs(table, column) >= FEWEST]
    factors = (HALVED, AS_FIXED, DOUBLED)
    others = {
        (column, factor): [
            agreed(counts(found, column, claim.id))
            for claim in CLAIMS
            if claim.is_tested and claim is not sixth
        ]
        for factor, found in verdicts(table, factors).groupby("factor")
        for column in columns
    }
    rows = []
    for words, limits in ways.items():
        claim = Claim(**vars(sixth) | {"limits": limits})
        row = [words]
        for column in columns:
            found = verdicts(table[table["reading"] == column], factors, [claim])
            given = [counts(each, column, "C6") for _, each in found.groupby("factor")]
            holds = [str(each[REPRODUCED] + each[PARTLY]) for each in given]
            reached = [
                title([*others[column, factor], agreed(each)])
                for factor, each in zip(factors, given, strict=True)
            ]
            told = reached[:1] if len(set(reached)) == 1 else reached
            row.append(f"{', '.join(holds)}: {', '.join(told)}")
        rows.append(row)
    return [
        "C6 decided by",
        *(f"{column}, {num_runs(table, column)} runs" for column in columns),
    ], rows


def basic(limit: Limit) -> Limit:
    """The same limit as a basic one."""
    return Limit(**vars(limit) | {"decides": "basic"})


def effects(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """What each change of the factorial does to some measurements, and the largest effect of a pair
    of changes: differences of means, with Student's 95 % intervals.

    A block is a seed with one rounding that has all runs of the factorial. The variance is that
    which readings and blocks leave (Box, Hunter and Hunter 2005, chapters 4 and 5), so that a few
    blocks of sixteen runs give it many degrees of freedom.

    Returns:
        Header and rows; no rows without a complete block.
    """
    signs_of = pd.DataFrame(
        {name: {reading: 1 if name in reading else -1 for reading in FACTORIAL} for name in FACTORS}
    )
    pairs = {
        f"{one} x {other}": signs_of[one] * signs_of[other]
        for one, other in itertools.combinations(FACTORS, 2)
    }
    planned = table[table["reading"].isin(FACTORIAL)]
    rows = []
    for claim, name in MEASURED:
        values = measurements(planned, claim).reindex(columns=[name])[name]
        values = values.unstack("reading").reindex(columns=FACTORIAL).dropna()
        if not len(values):
            continue
        half = _half_interval(values.to_numpy())
        of_change = 2 * values.mean() @ signs_of / len(FACTORIAL)
        of_pair = 2 * values.mean() @ pd.DataFrame(pairs) / len(FACTORIAL)
        largest = of_pair.abs().idxmax()
        rows.append(
            [
                f"{claim}: {name}",
                f"{values.to_numpy().mean():.3g}",
                *(_effect(of_change[change], half) for change in FACTORS),
                f"{largest}: {_effect(of_pair[largest], half)}",
            ]
        )
    return ["measurement", "mean", *FACTORS, "largest pair"], rows


def _half_interval(values: np.ndarray) -> float | None:
    """Half of the 95 % interval of every effect, from `values` of shape `(blocks, readings)`; None
    for one block, which leaves no variance.
    """
    from scipy.stats import t

    num_blocks, num_readings = values.shape
    freedom = (num_blocks - 1) * (num_readings - 1)
    if not freedom:
        return None
    left = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean()
    return float(t.ppf(0.975, freedom) * 2 * np.sqrt((left**2).sum() / freedom / values.size))


MEASURED = (
    ("C5", "late_accuracy"),
    ("C6", "auc_over_floor"),
    ("C6", "scale_difference"),
    ("C6", "lag_one_error"),
    ("C6", "rank_ratio"),
    ("C7", "auc_over_floor"),
    ("C8", "worse_half"),
)
"""Measurements for which the effects are shown."""


def _effect(mean: float, half: float | None) -> str:
    if half is None:
        return f"{mean:+.3g}"
    return f"{mean:+.3g} ({mean - half:+.3g} to {mean + half:+.3g})"


def most_common(found: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """The table of the README: for each reading its number of runs, and on each claim the most
    common verdict with its share of the runs.

    Args:
        found: The result of `verdicts`.

    Returns:
        Header and rows.
    """
    claims = [claim.id for claim in CLAIMS]
    rows = []
    of_reading = dict(iter(found.groupby("reading")))
    for reading in sorted(of_reading, key=list(READINGS).index):
        runs = of_reading[reading]
        row = [reading, str(len(runs[["rounding", "seed"]].drop_duplicates()))]
        for claim in claims:
            given = counts(runs, reading, claim) if touches(reading, claim) else None
            if given:
                ((verdict, number),) = given.most_common(1)
                row.append(f"{verdict} {number}/{given.total()}")
            else:
                row.append("")
        rows.append(row)
    return ["reading", "runs", *claims], rows


def shares(table: pd.DataFrame) -> pd.DataFrame:
    """The share of runs of each column, and of the former base, with each verdict on each claim, by
    the factor of the limits, for the figure.

    Returns:
        Columns `column`, `claim`, `factor` and one for each of `VERDICTS`.
    """
    found = verdicts(table[table["reading"].isin(DECIDING)], np.geomspace(0.25, 4, 33))
    keys = ["reading", "claim", "factor"]
    given = found.groupby(keys)["verdict"].value_counts(normalize=True).unstack(fill_value=0)
    given = given.reindex(columns=VERDICTS, fill_value=0)
    return given.reset_index().rename(columns={"reading": "column"})
