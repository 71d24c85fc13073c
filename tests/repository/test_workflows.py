"""Workflows: actionlint accepts them, and a fork has no file to edit."""

import re
import shutil
import subprocess

import pytest

from tests.clone import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("go") is None, reason="there is no go to build actionlint with")
def test_actionlint_accepts_the_workflows():
    subprocess.run([ROOT / ".ci" / "actionlint"], check=True)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("go") is None, reason="there is no go to build actionlint with")
def test_actionlint_finds_a_mistake(tmp_path):
    wrong = tmp_path / "wrong.yml"
    wrong.write_text("on: push\njobs:\n  one:\n    runs-on: ubuntu-24.04\n    step: []\n")
    assert subprocess.run([ROOT / ".ci" / "actionlint", wrong], capture_output=True).returncode == 1


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_names_no_repository_and_commands_that_exist(path):
    text = path.read_text(encoding="utf-8")
    assert "https://github.com" not in text
    modules = re.findall(r"python -m ([\w.]+)", text)
    found = [ROOT.joinpath(*name.split(".")) for name in modules if name != "pip"]
    assert all(
        place.with_suffix(".py").is_file() or (place / "__main__.py").is_file() for place in found
    )


def test_binder_installs_what_the_clone_requires():
    folder = ROOT / ".binder"
    (line,) = (folder / "requirements.txt").read_text(encoding="utf-8").splitlines()
    assert (folder / line.removeprefix("-r ")).resolve() == ROOT / "requirements.txt"
