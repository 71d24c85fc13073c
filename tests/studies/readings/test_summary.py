import collections
import itertools

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from enhsim_tf.paper.claims import CLAIMS, outside
from enhsim_tf.paper.report import UNDECIDED, read_published
from enhsim_tf.paper.settings import make_settings
from studies.common.command import PUBLISHED
from studies.readings import run as runs_of
from studies.readings.figure import FIGURES
from studies.readings.run import (
    AUTHOR,
    BASE,
    COLUMNS,
    DECIDING,
    FACTORIAL,
    FACTORS,
    KEPT,
    READINGS,
    Run,
    collect,
    runs,
)
from studies.readings.summary import (
    MEASURED,
    TOUCHED_BY,
    agreed,
    decide,
    effects,
    num_runs,
    publish,
    shares,
    signs,
    touches,
    verdicts,
)

C1 = CLAIMS[0]
GOOD = {"nrmse": 0.05, "coarse_nrmse": 0.6, "allowed_nrmse": 0.15, "ridge_nrmse": 0.03}
COMMON = 0.1  # reproduced, and partly at half of the limit


def table_of(nrmse):
    """A table of C1 with six runs of both columns; `nrmse` gives the error of a run, or None for a
    good one.
    """
    rows = []
    for run in runs(3, 1):
        measured = GOOD | ({"nrmse": nrmse(run)} if nrmse(run) else {})
        rows += [(*run, "C1", name, value) for name, value in measured.items()]
    return pd.DataFrame(rows, columns=[*runs_of.KEYS, "claim", "name", "value"])


def published_table():
    return pd.read_parquet(PUBLISHED / "readings" / "results" / "measurements.parquet")


def test_the_plan_has_all_readings_of_a_seed_before_the_next_seed():
    planned = runs(10, 5)
    assert len(planned) == len(set(planned)) == 2 * 10 + 2 * 10 + 15 * 5 + 5 * 5 + 10 + 5 + 3
    first = {run.reading: run for run in planned[:25]}
    assert set(first) == set(READINGS) - set(KEPT) and tuple(first)[:2] == COLUMNS
    assert set(first.values()) == {Run(reading, "oneDNN", 0) for reading in first}
    assert planned[-20:] == [Run(name, "Eigen", seed) for seed in range(10) for name in COLUMNS]


def test_the_published_runs_were_planned():
    done = {Run(*row) for row in published_table()[runs_of.KEYS].itertuples(index=False)}
    planned = set(runs(10, 5) + runs(10, 5, on_another=True))
    assert {run for run in done if run.reading not in KEPT} <= planned


def test_neither_changes_nor_pairs_of_them_are_confounded_in_the_factorial():
    assert len(FACTORIAL) == 16 and FACTORIAL[BASE] == {}
    signs_of = {
        name: np.array([1 if name in reading else -1 for reading in FACTORIAL]) for name in FACTORS
    }
    pairs = [one * other for one, other in itertools.combinations(signs_of.values(), 2)]
    columns = np.array([*signs_of.values(), *pairs])
    np.testing.assert_array_equal(columns @ columns.T, 16 * np.eye(15))


@pytest.mark.parametrize(
    ("nrmse", "expected"),
    [
        (lambda run: None, ("reproduced", None)),
        (lambda run: 2.0, ("not reproduced", None)),
        (lambda run: COMMON, (UNDECIDED, "limits halved")),
        (lambda run: 0.4 if run.seed == 2 else None, (UNDECIDED, "seed")),
        (lambda run: 0.2, (UNDECIDED, "limits doubled")),
        (lambda run: 2.0 if run.reading == AUTHOR else None, (UNDECIDED, AUTHOR)),
        # one of six
        (lambda run: 2.0 if run == Run(BASE, "Eigen", 2) else None, ("reproduced", None)),
        (lambda run: 2.0 if run.reading == "learning rate 0.01" else None, ("reproduced", None)),
    ],
)
def test_a_verdict_needs_every_deciding_reading_most_runs_and_every_factor(nrmse, expected):
    decided = decide(table_of(nrmse), C1)
    assert (decided["verdict"], decided["decided_by"]) == expected
    assert sum(decided["runs"]) == 12
    assert [sum(each) for each in decided["by_reading"].values()] == [6, 6, 0]


def test_fewer_than_five_runs_decide_nothing():
    table = table_of(lambda run: None)
    few = publish(table[(table["reading"] == BASE) & (table["rounding"] == "oneDNN")])
    assert few["claims"]["C1"]["decided_by"] == "too few runs"
    assert few["claims"]["C1"]["ranges"] == few["claims"]["C4"]["ranges"] == {}
    assert {claim["verdict"] for claim in few["claims"].values()} == {UNDECIDED}


def test_80_per_cent_of_the_runs_agree():
    assert agreed(collections.Counter(a=8, b=2)) == "a"
    assert agreed(collections.Counter(a=7, b=3)) == agreed(collections.Counter()) == UNDECIDED


def test_the_stages_that_claims_depend_on_exist():
    stages = {
        stage
        for field in make_settings().__dataclass_fields__.values()
        for stage in field.metadata["stages"]
    }
    assert set.union(*TOUCHED_BY.values()) < stages
    assert touches("2 pi + two updates", "C6") and not touches("2 pi + two updates", "C1")
    assert touches("2 pi + he_uniform", "C1") and not touches("latent scale 1", "C4")


def test_a_finished_run_is_kept_and_not_done_again(tmp_path, monkeypatch):
    done = []

    def fake(command, env, check):
        reading, rounding, seed, _, _, path = command[-6:]
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append((Run(reading, rounding, int(seed)), env["TF_ENABLE_ONEDNN_OPTS"]))
        rows = [(reading, rounding, int(seed), "C1", name, value) for name, value in GOOD.items()]
        pd.DataFrame(rows, columns=[*runs_of.KEYS, "claim", "name", "value"]).to_parquet(
            path, index=False
        )

    monkeypatch.setattr(runs_of.subprocess, "run", fake)
    planned = [*runs(1, 1)[:2], *runs(1, 1)[-2:]]
    arguments = ("smoke", tmp_path / "cache", tmp_path, lambda line: None)
    with pytest.raises(KeyboardInterrupt):
        collect(planned, *arguments)
    first, done[:] = list(done), []
    table = collect(planned, *arguments)
    assert [run for run, _ in first + done] == planned
    assert [flag for run, flag in first + done] == ["1", "1", "0", "0"]
    assert len(table) == len(planned) * len(GOOD) == len(pd.read_parquet(tmp_path / runs_of.TABLE))


def test_an_effect_of_the_factorial_is_the_difference_that_a_change_makes():
    rows = [
        (reading, "oneDNN", seed, *measured, 2.0 + 0.5 * ("2 pi" in reading) + 0.1 * seed)
        for reading in FACTORIAL
        for seed in range(3)
        for measured in MEASURED
    ]
    header, found = effects(pd.DataFrame(rows, columns=[*runs_of.KEYS, "claim", "name", "value"]))
    assert len(found) == len(MEASURED)
    for row in found:
        cells = dict(zip(header, row, strict=True))
        assert cells["2 pi"].startswith("+0.5 (+0.5 to +0.5)")
        assert float(cells["two updates"].split()[0]) == pytest.approx(0, abs=1e-9)


def test_the_interval_of_an_effect_is_that_of_least_squares():
    """Against a regression on all effects and blocks at once."""
    rng = np.random.default_rng(0)
    blocks = [("oneDNN", 0), ("oneDNN", 1), ("Eigen", 0)]
    claim, name = MEASURED[0]
    rows = [
        (reading, *block, claim, name, rng.normal()) for block in blocks for reading in FACTORIAL
    ]
    header, ((_, _, *cells, _),) = effects(
        pd.DataFrame(rows, columns=[*runs_of.KEYS, "claim", "name", "value"])
    )
    signs_of = np.array([[1 if change in row[0] else -1 for change in FACTORS] for row in rows])
    pairs = [
        signs_of[:, one] * signs_of[:, two] for one, two in itertools.combinations(range(5), 2)
    ]
    of_block = [[tuple(row[1:3]) == block for block in blocks] for row in rows]
    design = np.column_stack([signs_of, *pairs, np.array(of_block, float)])
    values = np.array([row[-1] for row in rows])
    found, (left,), rank, _ = np.linalg.lstsq(design, values)
    freedom = len(values) - rank
    errors = np.sqrt(left / freedom * np.diag(np.linalg.inv(design.T @ design)))
    half = stats.t.ppf(0.975, freedom) * errors
    expected = [
        f"{2 * mean:+.3g} ({2 * (mean - side):+.3g} to {2 * (mean + side):+.3g})"
        for mean, side in zip(found[:5], half[:5], strict=True)
    ]
    assert cells == expected


def test_the_shares_of_the_figure_add_up_and_follow_the_factor():
    found = shares(table_of(lambda run: COMMON))
    first = found[found["claim"] == "C1"]
    first = first[first["column"].isin(COLUMNS)]
    assert first[["reproduced", "partly", "not reproduced"]].sum(axis=1).eq(1).all()
    assert (first["reproduced"] == (first["factor"] * 0.15 >= COMMON)).all()
    data = {"shares": found, "basis": ""}
    assert len(FIGURES["verdicts"].draw(data).axes) == len(DECIDING) * len(CLAIMS)


def test_the_published_verdicts_come_from_the_published_table(near):
    assert read_published() == near(publish(published_table()))


def test_the_title_is_told_for_every_statistic_column_and_factor():
    header, rows = signs(published_table())
    readings = [name for name in DECIDING if num_runs(published_table(), name) >= 5]
    assert len(header) == 1 + len(readings) and len(rows) == 6
    for cell in (cell for row in rows for cell in row[1:]):
        counted, _, told = cell.partition(": ")
        holds = [int(number) for number in counted.split(", ")]
        assert len(holds) == 3 and holds == sorted(holds)  # wider limits lose no run
        assert set(told.replace(", in part", "").split(", ")) <= {"[Re]", "[¬Re]"}


def test_a_run_whose_seed_is_left_out_lies_within_the_ranges_of_the_others():
    table = published_table()
    decisive = table[table["reading"].isin(DECIDING)]
    all_runs = decisive.groupby(runs_of.KEYS)
    others = {
        seed: publish(decisive[decisive["seed"] != seed]) for seed in decisive["seed"].unique()
    }
    named = []
    for run, part in all_runs:
        records = [
            {"id": claim, "measured": dict(zip(rows["name"], rows["value"], strict=True))}
            for claim, rows in part.groupby("claim")
        ]
        named += [run] if outside(records, others[run[2]]) else []
    assert len(named) <= 0.1 * len(all_runs)


def test_verdicts_follow_the_measurements():
    assert set(verdicts(table_of(lambda run: 0.4))["verdict"]) == {"partly"}
