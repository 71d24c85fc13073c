"""The command on small files in both layouts."""

import json

import pytest

from enhsim_tf.datasets.anomalies import INJECTIONS
from studies.public_benchmarks import run
from studies.public_benchmarks.__main__ import command
from studies.public_benchmarks.arms import ARMS, CHOSEN
from studies.public_benchmarks.onsets import FAULTS
from studies.public_benchmarks.peers import RANDOM, peers
from studies.public_benchmarks.series import SKAB, SPACECRAFT
from studies.public_benchmarks.summary import KEPT
from studies.public_benchmarks.tool import TOOL
from tests.studies.public_benchmarks import synthetic

QUICK = ("PCA error", "moving deviation", RANDOM)


@pytest.mark.slow
def test_every_method_has_a_row_on_every_series_and_a_second_run_computes_nothing(
    tmp_path, monkeypatch, capsys
):
    def quick(window, seed):
        return {name: peers(window, seed)[name] for name in QUICK}

    monkeypatch.setattr(run, "peers", quick)
    folders = [synthetic.write_spacecraft(tmp_path / "a"), synthetic.write_skab(tmp_path / "b")]
    synthetic.write_skab(tmp_path / "b", "valve1/1", anomaly=0.0)
    words = ["--data", *folders, "--budget", "smoke", "--out", tmp_path, "--cache", tmp_path / "c"]
    assert command([str(word) for word in words]) == 0
    rows, onsets = (KEPT.read(tmp_path)[name] for name in ("scores", "onsets"))
    found = json.loads((tmp_path / "findings.json").read_text(encoding="utf-8"))
    assert set(rows["series"]) == {"A-1", "Z-1", "valve1/0"} and len(rows) == 3 * 8
    assert set(rows["method"]) == {*ARMS, CHOSEN, TOOL, *QUICK} and "valve1/1" in found["left_out"]
    # of each kind one on the spacecraft, none where nominal time is short, and the examples
    assert (
        set(onsets["kind"]) == {*INJECTIONS, *FAULTS} and not (onsets["series"] == "Z-1").sum() % 8
    )
    assert found["onsets"]["examples"]["heater"]["onset_error"] <= 10
    assert list(found["groups"]) == [
        *(f"{SPACECRAFT}, {kind}" for kind in ("development", "others")),
        f"{SKAB}, development",
    ]
    # values far outside are found, and random scores find them by chance alone
    for group in found["groups"].values():
        methods = group["methods"]
        assert methods[ARMS[0]]["auc_pr"]["mean"] > 0.9 > methods[RANDOM]["auc_pr"]["mean"] + 0.2
        assert methods[TOOL]["found"] == methods[ARMS[0]]["found_at_0.01"] == 1
    capsys.readouterr()
    assert command([str(word) for word in words]) == 0
    assert " ...\n" not in capsys.readouterr().out
    assert json.loads((tmp_path / "findings.json").read_text(encoding="utf-8")) == found


def test_a_folder_in_another_form_is_one_line(tmp_path, capsys):
    words = ["--data", str(tmp_path), "--out", str(tmp_path / "out"), "--cache", str(tmp_path)]
    assert command(words) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
