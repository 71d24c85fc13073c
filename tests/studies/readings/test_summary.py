import pandas as pd
import pytest

from enhsim_tf.paper.claims import outside
from enhsim_tf.paper.report import UNDECIDED, read_published
from enhsim_tf.paper.settings import make_settings
from studies.common.command import PUBLISHED
from studies.readings import run as runs_of
from studies.readings.figure import FIGURES
from studies.readings.run import READINGS, Run, collect, runs
from studies.readings.summary import TOUCHED_BY, decide, publish, shares, touches, verdicts

GOOD, BAD = {"nrmse": 0.1, "coarse_nrmse": 0.6, "allowed_nrmse": 0.15, "ridge_nrmse": 0.03}, 0.7


def table_of(bad):
    """A table of C1: three seeds of the reference with both roundings, two of the others; `bad` says which runs fail."""
    rows = []
    for run in runs(3, 2):
        measured = GOOD | ({"nrmse": BAD} if bad(run) else {})
        rows += [(*run, "C1", name, value) for name, value in measured.items()]
    return pd.DataFrame(rows, columns=[*runs_of.KEYS, "claim", "name", "value"])


def published_table():
    return pd.read_parquet(PUBLISHED / "readings" / "results" / "measurements.parquet")


def test_the_plan_has_both_roundings_of_the_reference_and_complete_first_seeds():
    planned = runs(10, 5)
    assert len(planned) == len(set(planned)) == 10 * 2 + 5 * (len(READINGS) - 1)
    assert set(runs(10, 5, on_another=True) + planned) == {
        Run(*row) for row in published_table()[runs_of.KEYS].itertuples(index=False)
    }
    assert {run.seed for run in planned[: len(READINGS) + 1]} == {0}


@pytest.mark.parametrize(
    ("bad", "expected"),
    [
        (lambda run: False, ("reproduced", 6, None)),
        (lambda run: True, ("not reproduced", 6, None)),
        (lambda run: run == Run("reference", "Eigen", 2), ("reproduced", 5, None)),  # 83 %
        (lambda run: run.reading == "reference" and run.seed == 2, (UNDECIDED, 4, "seed")),  # 67 %
        (
            lambda run: run.reading == "15,000 windows",
            ("reproduced", 6, None),
        ),  # one of three readings that touch the enhancer
        (
            lambda run: run.reading in ("15,000 windows", "learning rate 0.01"),
            (UNDECIDED, 6, "learning rate 0.01, 15,000 windows"),
        ),
        (
            lambda run: run.reading == "no dropout",
            ("reproduced", 6, None),
        ),  # does not touch the enhancer
    ],
)
def test_a_verdict_needs_most_seeds_of_the_reference_and_most_readings(bad, expected):
    decided = decide(verdicts(table_of(bad)), "C1")
    assert (decided["verdict"], max(decided["runs"]), decided["decided_by"]) == expected


def test_the_stages_that_claims_depend_on_exist():
    stages = {
        stage
        for field in make_settings().__dataclass_fields__.values()
        for stage in field.metadata["stages"]
    }
    assert set.union(*TOUCHED_BY.values()) < stages
    assert touches("two updates of 200 rows", "C6") and not touches("two updates of 200 rows", "C1")
    assert touches("he_uniform in every layer", "C1") and not touches("no dropout", "C4")


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
    planned, arguments = runs(1, 1)[:4], ("smoke", tmp_path / "cache", tmp_path, lambda line: None)
    with pytest.raises(KeyboardInterrupt):
        collect(planned, *arguments)
    first, done[:] = list(done), []
    table = collect(planned, *arguments)
    assert [run for run, _ in first + done] == planned
    assert [flag for run, flag in first] == ["1", "0"]
    assert len(table) == len(planned) * len(GOOD) == len(pd.read_parquet(tmp_path / runs_of.TABLE))


def test_the_figure_shows_a_share_for_each_reading_that_touches_a_claim():
    found = shares(verdicts(table_of(lambda run: run.seed == 0)))
    assert found.groupby("reading")["share"].sum().to_dict() == pytest.approx(
        {name: 1.0 for name in READINGS if touches(name, "C1")}
    )
    assert FIGURES["verdicts"].draw({"shares": found}).axes


def test_the_published_verdicts_come_from_the_published_table(near):
    assert read_published() == near(publish(published_table()))


def test_few_sound_runs_are_outside_the_ranges_of_all_other_seeds():
    table, named = published_table(), []
    for (reading, rounding, seed), run in table[table["reading"] == "reference"].groupby(
        runs_of.KEYS
    ):
        others = publish(table[(table["reading"] != reading) | (table["seed"] != seed)])
        records = [
            {"id": claim, "measured": dict(zip(part["name"], part["value"], strict=True))}
            for claim, part in run.groupby("claim")
        ]
        named += [(rounding, seed)] if outside(records, others) else []
    assert named == [("Eigen", 4)]  # its enhancer ended at twice the error of all others
