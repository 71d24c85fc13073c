"""Fixtures of the tests of studies."""

import re
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture
def numbers_of():
    """`numbers_of(study)` gives the numbers of the tables in a study's README, by the first cell of a row."""

    def numbers_of(study: str) -> dict[str, list[float]]:
        text = (STUDIES / study / "README.md").read_text(encoding="utf-8")
        rows = (line.strip("| ").split(" | ", 1) for line in text.splitlines() if line.startswith("| "))
        return {name: [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", cells)] for name, cells in rows}

    return numbers_of


@pytest.fixture
def narrow_networks(monkeypatch):
    """Every enhancer of the tool has 64 units in each hidden layer instead of 3,200."""
    from enhsim_tf.enhancer import candidates

    monkeypatch.setattr(candidates, "_PAPER_UNITS", 64)
