"""The command that all studies share refuses what it cannot do, in one line and before it writes
anything; its settings.
"""

import importlib

import pytest

from studies.common.command import PUBLISHED
from studies.common.settings import make_settings
from tests.studies.test_published import STUDIES


@pytest.mark.parametrize(
    ("study", "words"),
    [
        *((study, f"--budget smoke --out {PUBLISHED / study / 'results'}") for study in STUDIES),
        ("robustness", "--seeds 0"),
        ("robustness", "--seeds many"),
        ("robustness", "--unknown"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(study, words, capsys, tmp_path, monkeypatch):
    command = importlib.import_module(f"studies.{study}.__main__").command
    monkeypatch.chdir(tmp_path)
    assert command(words.split()) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert line.startswith("error: Expected ") and "Received: " in line and not said.out
    assert not list(tmp_path.iterdir())


def test_a_budget_and_changes_reach_their_groups(refused):
    made = make_settings("smoke", paper__seed=4, robustness__num_seeds=7)
    assert (made.seed, made.paper.epochs) == (4, 2)
    assert (made.robustness.num_seeds, made.robustness.num_windows) == (7, 200)
    assert made.of("shot", 9).noise == "shot" and made.of("shot", 9).seed == 9
    with refused("'noise'"):
        make_settings(noise="shot")
