"""The command that all studies share refuses what it cannot do, in one line and before it writes anything; its settings."""

import importlib

import pytest

from studies.common.settings import make_settings

STUDIES = (
    "robustness",
    "factorial",
    "noise_models",
    "few_windows",
    "spacecraft",
    "battery",
    "reference_or_source",
)


@pytest.mark.parametrize("study", STUDIES)
@pytest.mark.parametrize(
    "words",
    [
        ["--seeds", "0"],
        ["--seeds", "many"],
        ["--unknown"],
        ["--budget", "smoke", "--out", "studies/{}/results"],
    ],
    ids=" ".join,
)
def test_what_cannot_be_done_is_refused_in_one_line(study, words, capsys, tmp_path, monkeypatch):
    command = importlib.import_module(f"studies.{study}.__main__").command
    if "--out" not in words:
        monkeypatch.chdir(tmp_path)
    assert command([word.format(study) for word in words]) == 2
    said = capsys.readouterr()
    lines = said.err.splitlines()
    assert (
        len(lines) == 1
        and lines[0].startswith("error: Expected ")
        and "Received: " in lines[0]
        and not said.out
    )
    assert not list(tmp_path.iterdir())


def test_a_budget_and_changes_reach_their_groups(refused):
    made = make_settings("smoke", paper__seed=4, robustness__num_seeds=7)
    assert (
        made.seed,
        made.paper.epochs,
        made.robustness.num_seeds,
        made.robustness.num_windows,
    ) == (4, 2, 7, 200)
    assert made.of("shot", 9).noise == "shot" and made.of("shot", 9).seed == 9
    with refused("'noise'"):
        make_settings(noise="shot")
