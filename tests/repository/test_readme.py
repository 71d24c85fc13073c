"""The README: its program prints what stands below it, in any folder."""

import re

from enhsim_tf import example
from tests.clone import ROOT, python


def test_the_program_prints_what_stands_below_it(tmp_path):
    blocks = re.findall(r"```(\w*)\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    place = next(number for number, (kind, _) in enumerate(blocks) if kind == "python")
    assert python(blocks[place][1], cwd=tmp_path).stdout == blocks[place + 1][1]


def test_an_unknown_example_is_refused(refused):
    with refused("new.csv", "'old.csv'"):
        example("old.csv")
