"""Tests the command of the factorial experiment: finished cells are kept, and the others are computed in the order of the parts."""

import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce import __main__ as command
from studies.factorial import run as runs
from studies.factorial.cells import CELLS, PUBLISHED, REFERENCES, rounds
from studies.robustness.replicate import QUICK_DETECTORS

FINDINGS = {"num_cells": 1, "of_cells": 1, "seeds": [2_000], "environments": ["shot"], "shares": {}}  # where only the table matters


def rows(environment, seed, name, alarms=5):
    about = {"environment": environment, "seed": seed, "cell": name}
    about |= {"windows": 59, "alarms": {"coarse": 40, "real": 1}.get(name, alarms), "recall": 0.51234567, "recall_at_real_rate": 0.25}
    return pd.DataFrame([about | {"detector": detector} for detector in ("limit check", "PCA residual")])[[*runs.KEYS, *runs.VALUES]]


@pytest.fixture
def computed(monkeypatch):
    """Replaces training and detectors by made-up rows, and records what is computed."""
    seen = []

    def evaluated(one, names):
        for name in names:
            seen.append((*one, name))
            yield name, rows(*one, name)

    monkeypatch.setattr(runs, "pipelines", lambda settings, stages, environment, seed: (environment, seed))
    monkeypatch.setattr(runs, "evaluated", evaluated)
    return seen


def experiment(folder, *options):
    words = [
        "--experiment",
        "factorial",
        "--budget",
        "smoke",
        "--seeds",
        "2",
        "--out",
        str(folder / "out"),
        "--cache",
        str(folder / "cache"),
    ]
    return command.main([*words, *options])


def test_cheap_rounds_come_first_for_every_environment_and_seed(computed, tmp_path, capsys):
    assert experiment(tmp_path) == 0
    (first,), (many, paper), *others = rounds()
    order = [(first, 2_000), (first, 2_001), (many, 2_000), (paper, 2_000), (many, 2_001), (paper, 2_001)]
    order += [(names, seed) for (names,) in others for seed in (2_000, 2_001)]
    assert computed == [(environment, seed, name) for names, seed in order for environment in command.NOISES for name in names]
    said = capsys.readouterr().out
    assert "256 of 256 runs (a cell, an environment and a seed; 2 seeds, 2000 to 2001, in 4 environments)" in said
    folder = tmp_path / "out" / runs.FOLDER
    assert {path.name for path in folder.iterdir()} == {"cells.csv", "findings.json", "contributions.png", "contributions.svg"}
    assert 'id="watermark"' in (folder / "contributions.svg").read_text(encoding="utf-8")
    assert (folder / "cells.csv").read_text(encoding="utf-8").splitlines()[1].endswith(",40,59,0.5123,0.25")


def test_finished_cells_are_not_computed_again(computed, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "write_findings", lambda folder, budget: FINDINGS)
    folder = tmp_path / "out" / runs.FOLDER
    folder.mkdir(parents=True)
    names = [*REFERENCES, *list(CELLS)[3:]]
    runs.write_cells(pd.concat([rows("shot", 2_000, name, alarms=9) for name in names]), folder / runs.TABLE)
    assert experiment(tmp_path, "--environment", "shot", "--seeds", "1") == 0
    assert {name for _, _, name in computed} == set(list(CELLS)[:3])
    table = runs.read_cells(folder / runs.TABLE)
    assert len(table) == 2 * 34 and (table[table["cell"] == list(CELLS)[5]]["alarms"] == 9).all()
    computed.clear()
    assert experiment(tmp_path, "--environment", "shot", "--seeds", "1", "--fresh") == 0 and len(computed) == 34


def test_an_interrupted_run_keeps_its_cells(computed, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "write_findings", lambda folder, budget: FINDINGS)
    complete = runs.evaluated

    def interrupted(one, names):
        for number, each in enumerate(complete(one, names)):
            if number == 4:
                raise KeyboardInterrupt
            yield each

    monkeypatch.setattr(runs, "evaluated", interrupted)
    assert experiment(tmp_path, "--environment", "shot", "--seeds", "1") == 130
    assert runs.read_cells(tmp_path / "out" / runs.FOLDER / runs.TABLE)["cell"].nunique() == 4
    monkeypatch.setattr(runs, "evaluated", complete)
    computed.clear()
    assert experiment(tmp_path, "--environment", "shot", "--seeds", "1") == 0 and len(computed) == 34 - 4


def test_alarms_are_added_up_and_recall_is_averaged():
    alarms = pd.DataFrame({"detector": ["a", "a", "b"], "alarms": [1, 2, 3], "windows": [10, 11, 12], "block": [0, 1, 0]})
    recall = pd.DataFrame({"detector": ["a", "a", "b"], "recall": [0.0, 1.0, 0.25], "recall_at_real_rate": [0.2, 0.4, 0.5]})
    found = runs.collected(alarms, recall, ["detector"])
    assert found.values.tolist() == [["a", 3, 21, 0.5, pytest.approx(0.3)], ["b", 3, 12, 0.25, 0.5]]


def test_cells_of_the_experiment_on_robustness_are_taken_over(tmp_path):
    assert runs.published(tmp_path) is None
    about = {"environment": ["white"] * 3, "seed": 2_000, "arm": ["real", "enhanced + AR", "enhanced"], "detector": ["PCA residual"] * 3}
    pd.DataFrame({**about, "block": 0, "alarms": [1, 2, 3], "windows": 100}).to_parquet(tmp_path / "alarms.parquet")
    pd.DataFrame({**about, "recall": [0.1, 0.2, 0.3], "recall_at_real_rate": 0.5}).to_parquet(tmp_path / "recall.parquet")
    table = runs.published(tmp_path).set_index("cell")
    assert table.loc[PUBLISHED["enhanced + AR"], ["alarms", "windows", "recall"]].tolist() == [2, 100, 0.2]
    assert set(table["detector"]) <= set(QUICK_DETECTORS) and len(table) == 2


def test_another_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="Received: no "):
        runs.read_cells(tmp_path / "cells.csv")
    for text in ("a,b\n1,2\n", ",".join([*runs.KEYS, *runs.VALUES]) + "\nwhite,1,real,a,1,2,,0.5\n"):
        (tmp_path / "cells.csv").write_text(text)
        with pytest.raises(InputError, match="another table"):
            runs.read_cells(tmp_path / "cells.csv")
