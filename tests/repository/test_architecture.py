"""The map in docs/architecture.md is that of the package."""

import re
import tomllib

import pytest

from tests.clone import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PLACES = sorted(set(re.findall(r"`([a-z_]+(?:/[a-z_]+)*(?:\.py|/))`", PAGE)))


@pytest.mark.parametrize("place", PLACES)
def test_every_place_that_is_named_is_there(place):
    assert (ROOT / "enhsim_tf" / place).exists() or (ROOT / place).exists()


def test_the_tree_has_the_layers_that_imports_are_checked_against():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    layers = next(each["layers"] for each in contracts if each["type"] == "layers")
    expected = [layer.split(" | ") for layer in layers if layer != "__main__"]
    tree = PAGE.partition("```text\n")[2].partition("```")[0].splitlines()
    words = [
        re.split(r"\s{3,}| {2,}|(?<=py) ", line)[: len(layer)]
        for line, layer in zip(tree, expected, strict=True)
    ]
    assert [[word.removesuffix(".py") for word in line] for line in words] == expected
    # what is not in the layers is not in the package
    names = {path.name.removesuffix(".py") for path in (ROOT / "enhsim_tf").iterdir()}
    assert names - {"__init__", "__main__", "__pycache__"} == {
        name for line in expected for name in line
    }


def test_only_the_commands_know_the_command_line():
    package = ROOT / "enhsim_tf"
    users = {
        path.relative_to(package).parts[0]
        for path in package.rglob("*.py")
        if re.search(r"^\s*(import|from) argparse", path.read_text(encoding="utf-8"), re.MULTILINE)
        and path.name != "console.py"
    }
    assert users == {"cli", "reproduce.py"}
