import json
import re

import pytest

from enhsim_tf.paper import command, report
from enhsim_tf.paper.claims import judge_all
from enhsim_tf.paper.figures import FIGURES
from tests.paper.conftest import TINY


@pytest.fixture(scope="module")
def ran(cache, pipeline, tmp_path_factory):
    """The command at the tiny size, which finds the stages of the pipeline in the cache."""
    judge_all(pipeline)
    out = tmp_path_factory.mktemp("out")
    options = [word for name, value in TINY.items() for word in ("--set", f"{name}={'no' if value is False else value}")]
    code = command.main(["--budget", "smoke", "--cache", str(cache), "--out", str(out), *options])
    return code, out, json.loads((out / "results.json").read_text())


def test_every_figure_is_written_and_the_page_shows_it(ran):
    code, out, _ = ran
    assert code == 0
    page = (out / "report.html").read_text()
    for name in FIGURES:
        assert (out / f"{name}.png").read_bytes()[:4] == b"\x89PNG"
        assert f'id="{name}"' in page and (out / f"{name}.svg").stat().st_size > 1_000
    assert not re.search(r"<script|https?://(?!arxiv\.org)[^\"]*\"", re.sub(r'src="data:[^"]*"', "", page))


def test_the_box_is_the_same_on_the_terminal_in_the_results_and_in_markdown(ran):
    box = ran[2]["box"]
    for table in (report.as_text(box), report.as_markdown(box)):
        for row in box:
            assert all(value in table for value in row.values())
    assert [row["this run"] for row in box] == [claim["verdict"] for claim in ran[2]["claims"]]


def test_what_the_box_shows_is_what_decides():
    limits = [{"name": "x", "words": "x", "value": 0.25, "low": None, "high": 0.1, "decides": "basic", "holds": False}]
    record = {"id": "C1", "short": "s", "verdict": "not reproduced", "deciding": limits[0]}
    published = {"claims": {"C1": {"verdict": "undecided", "agreeing": 6, "of": 10}}}
    assert report.box([record], published)[0] == {
        "claim": "C1 s",
        "published": "undecided, 6 of 10 runs",
        "this run": "not reproduced",
        "because": "x: 0.25, needed at most 0.1",
    }


@pytest.mark.parametrize(
    ("arguments", "different", "code"), [([], ["C1: nrmse"], 1), ([], [], 0), ([], None, 0), (["--budget", "smoke"], ["C1: nrmse"], 0)]
)
def test_the_exit_code_says_whether_a_measurement_lies_outside_its_published_range(arguments, different, code, capsys):
    assert command.conclude(command.parse(arguments), different) == code
    assert ("C1: nrmse" in capsys.readouterr().out) == (code == 1)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "dropout"],
        ["--set", "no_such=1"],
        ["--only", "fig99"],
        ["--seed", "-1"],
        ["--column", "volts"],
        ["--telemetry", "no_such.csv"],
        ["--store", "postgres"],
        ["--budget", "smoke", "--out", "figures"],
        ["--budget", "huge"],
    ],
)
def test_an_option_that_cannot_be_used_gives_one_line_and_code_2(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command.main(arguments) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and re.match(r"error: Expected .*Received: ", lines[0])
    assert not list(tmp_path.rglob("*.png"))
