"""The command, end to end: what it writes, and that a run found done, killed or repeated ends with the same numbers."""

import dataclasses
import json
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common import figure
from enhsim_tf.reproduce import __main__ as command
from enhsim_tf.reproduce import report as page
from enhsim_tf.reproduce.__main__ import main, parse
from enhsim_tf.reproduce.paper import claims, figures
from enhsim_tf.reproduce.paper.figures import FIGURES

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-m", "enhsim_tf.reproduce"]
STAGES = ["telemetry", "enhancer", "noise GAN", "enhancement", "speed", "false alarms", "resemblance", "degraded"]


def _command(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, timeout=600)


def _without_timing(found):
    return [claim for claim in found["claims"] if claim["id"] != "C2"]


def _results(out):
    return json.loads((out / "results.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def smoke(smoke_run):
    """One undisturbed smoke run."""
    return SimpleNamespace(**vars(smoke_run), done=smoke_run, found=_results(smoke_run.out))


# -- help ------------------------------------------------------------------------------------------------------------------


ANSWERS = [
    (["--help"], 0),
    (["--seed", "-1"], 2),
    (["--seed", "abc"], 2),
    (["--only", "fig99"], 2),
    (["--out", "README.md/below"], 2),
    (["--cache", "README.md/below", "--out", "."], 2),
    (["--experiment", "robustness", "--out", "README.md/below"], 2),
]


@pytest.mark.parametrize(("arguments", "code"), ANSWERS)
def test_answers_that_need_no_network_import_none(arguments, code):
    slow = "{'tensorflow', 'keras', 'matplotlib', 'pandas', 'sklearn'}"
    program = f"""
import sys
from enhsim_tf.reproduce.__main__ import main
try:
    code = main({arguments!r})
except SystemExit as left:
    code = left.code
print()
print(code, sorted({slow} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1] == f"{code} []", done.stderr
    if code == 0:
        assert "--budget" in done.stdout and "exit code" in done.stdout


# -- a smoke run -----------------------------------------------------------------------------------------------------------


def test_a_smoke_run_draws_every_figure_and_marks_it(smoke):
    expected = {f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")} | {"results.json", "report.html"}
    assert {file.name for file in smoke.out.iterdir()} == expected, "nothing is missing and nothing half written is left"
    for name in FIGURES:
        assert (smoke.out / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
        drawn = (smoke.out / f"{name}.svg").read_text(encoding="utf-8")
        ElementTree.fromstring(drawn)
        assert "SMOKE" in drawn and "seed 0" in drawn and "smoke budget" in drawn


def test_a_smoke_run_touches_nothing_that_is_committed(smoke):
    assert not smoke.touched


def test_results_hold_the_ledger_and_the_table_says_the_same(smoke):
    found = smoke.found
    assert (found["budget"], found["seed"], found["from_cache"]) == ("smoke", 0, [])
    assert list(found["timings"]) == [*STAGES, "figures"] and min(found["timings"].values()) > 0
    assert {"python", "tensorflow", "keras", "numpy"} <= set(found["versions"])
    assert [claim["id"] for claim in found["claims"]] == [claim.id for claim in claims.CLAIMS]
    for claim in found["claims"]:
        assert {"id", "sentence", "section", "figure", "statistic", "value", "tolerance", "verdict", "finding"} <= set(claim)
        assert claim["verdict"] in {"reproduced", "partly", "not reproduced", "not tested by the paper"}
        is_none = claim["value"] is None and claim["id"] == "C4"  # no iteration from which the noise stays within tolerance
        assert is_none or (isinstance(claim["value"], float) and np.isfinite(claim["value"]))
        assert any(line.startswith(claim["id"]) and claim["verdict"] in line for line in smoke.done.stdout.splitlines())
    assert found["verdict"] in smoke.done.stdout and str(smoke.out) in smoke.done.stdout


def test_progress_bars_are_quiet_where_there_is_no_terminal(smoke):
    assert "\r" not in smoke.done.stdout + smoke.done.stderr
    assert not any(word in smoke.done.stderr for word in ("Epoch", "it/s", "iteration", "Traceback"))


@pytest.fixture(scope="module")
def again(smoke, tmp_path_factory):
    """The same once more, with the arrays and a second seed."""
    out, before = tmp_path_factory.mktemp("again"), smoke.committed()
    done = _command("--budget", "smoke", "--out", out, "--cache", smoke.cache, "--arrays", "--spread", 1)
    assert done.returncode == 0, done.stderr
    assert before == smoke.committed()
    return SimpleNamespace(out=out, done=done, found=_results(out))


def test_a_second_run_finds_everything_done(smoke, again):
    assert again.found["from_cache"] == STAGES
    assert again.found["claims"] == smoke.found["claims"]
    for name in STAGES:
        assert again.found["timings"][name] == smoke.found["timings"][name], "what it took when it was done"
    for name in FIGURES:
        assert (again.out / f"{name}.png").read_bytes() == (smoke.out / f"{name}.png").read_bytes()


def test_another_seed_gives_other_numbers(again):
    spread = json.loads((again.out / "spread.json").read_text(encoding="utf-8"))
    assert (spread["budget"], spread["seeds"]) == ("smoke", [0, 1])
    for claim in again.found["claims"]:
        if claim["value"] is None:  # C4: no iteration from which the noise stays within tolerance
            continue
        low, high = spread["claims"][claim["id"]]["range"]
        assert low <= claim["value"] <= high and len(spread["claims"][claim["id"]]["verdicts"]) == 2
        if claim["id"] in ("C1", "C6", "C9"):
            assert low < high


def test_the_arrays_behind_each_figure_are_the_claims_numbers(again):
    arrays = {name: np.load(again.out / f"{name}.npz", allow_pickle=False) for name in FIGURES}
    value = {claim["id"]: claim["value"] for claim in again.found["claims"]}
    assert arrays["fig04_enhanced_simulation"]["nrmse"] == value["C1"]
    ranks = arrays["fig06_real_or_generated_noise"]
    assert ranks["rank_generated"] / ranks["rank_real"] == pytest.approx(value["C6"])
    accuracy = [arrays["fig12_accuracy_loss"][f"accuracy_{kind}"] for kind in ("real", "generated")]
    assert np.mean(accuracy, axis=0)[len(accuracy[0]) // 2 :].mean() == pytest.approx(value["C5"])
    assert arrays["fig03_enhancer"]["total"] == 13_697_400
    source = arrays["fig02_source_target"]["source"]
    assert source.shape[1] == 500 and set(np.abs(np.unique(source))) == {0.25, 0.75}


def test_only_one_figure_trains_nothing(tmp_path, capsys, smoke):
    arguments = ["--budget", "smoke", "--only", "fig02", "--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"), "--arrays"]
    assert main(arguments) == 0
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [f"fig02_source_target.{kind}" for kind in ("npz", "png", "svg")]
    (stage,) = (tmp_path / "cache").iterdir()
    assert stage.name.startswith("telemetry-")
    told = capsys.readouterr()
    assert "enhancer" not in told.out and "C1" not in told.out
    assert (tmp_path / "out" / "fig02_source_target.png").read_bytes() == (smoke.out / "fig02_source_target.png").read_bytes()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_table_with_times_keeps_them(tmp_path, kind):
    times = np.datetime64("2021-03-04T05:06:07") + np.arange(2_000) * np.timedelta64(30, "s")
    values = np.sin(np.arange(2_000) / 15) + 0.1 * np.random.default_rng(0).standard_normal(2_000)
    table = pd.DataFrame({"utc": times, "volts": values, "amperes": 0.0})
    table.to_csv(tmp_path / "x.csv", index=False) if kind == "csv" else table.to_parquet(tmp_path / "x.parquet")
    arguments = ["--telemetry", tmp_path / f"x.{kind}", "--column", "volts", "--time", "utc", "--only", "fig14", "--arrays"]
    assert main([str(argument) for argument in [*arguments, "--out", tmp_path / "out", "--cache", tmp_path / "cache"]]) == 0
    found = np.load(tmp_path / "out" / "fig14_telemetry_store.npz", allow_pickle=False)
    assert np.array_equal(found["time"], times) and found["interval_s"] == 30 and found["num_samples"] == 2_000
    np.testing.assert_allclose(found["values"], values, atol=1e-6)


# -- killed and started again ----------------------------------------------------------------------------------------------


def _start_and_kill(arguments, pattern, pause_s=0.0, drawn=None):
    """Starts the command and kills it after it said a line like `pattern`; returns what it said.

    Args:
        arguments: Of the command.
        pattern: A regular expression.
        pause_s: Seconds from that line on.
        drawn: A folder; it is killed as soon as three figures are there.
    """
    process = subprocess.Popen([*COMMAND, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    said = []
    for text in process.stdout:
        said.append(" ".join(text.split()))
        if re.fullmatch(pattern, said[-1]):
            time.sleep(pause_s)
            while drawn is not None and len(list(drawn.glob("[!.]*.png"))) < 3 and process.poll() is None:
                time.sleep(0.002)
            break
    process.send_signal(signal.SIGKILL)
    said += [" ".join(text.split()) for text in process.stdout]
    assert process.wait() == -signal.SIGKILL, f"it was to be killed at {pattern!r}, and said {said}"
    return said


def test_killed_in_each_stage_it_ends_with_the_same_numbers(smoke, tmp_path):
    cache, out = tmp_path / "cache", tmp_path / "out"
    arguments = ["--budget", "smoke", "--out", str(out), "--cache", str(cache)]
    pauses = {"telemetry": 0.0, "enhancer": 0.5, "noise GAN": 1.5, "false alarms": 0.7}  # long stages are killed well inside
    for number, stage in enumerate(STAGES):
        said = _start_and_kill(arguments, rf"{stage} \.\.\.", pauses.get(stage, 0.05))
        for earlier in STAGES[: max(number - 1, 0)]:  # the last one before was killed in its turn and is done anew
            assert any(line.startswith(earlier) and "(from the cache)" in line for line in said), "an earlier stage is found done"
        assert not list(cache.glob(f"{stage}-*")), "no part of the killed stage stands under its name"
    _start_and_kill(arguments, r"degraded [0-9.]+ s", drawn=out)  # while it draws
    images = list(out.glob("[!.]*.png"))
    assert images
    for image in images:
        assert image.read_bytes()[-8:-4] == b"IEND", "every figure is whole"
    assert not (out / "results.json").exists()

    done = _command(*arguments)
    assert done.returncode == 0, done.stderr
    found = _results(out)
    assert found["from_cache"] == STAGES
    assert len(list(cache.iterdir())) == len(STAGES), "what the killed runs left is cleared away"
    assert _without_timing(found) == _without_timing(smoke.found), "to the last digit, in another cache"


# -- full budget: exit codes and the README, with the work itself left out -------------------------------------------------


def with_arrays(arrays):
    """The figures of the paper, with another function for their arrays."""
    return {name: dataclasses.replace(FIGURES[name], arrays=arrays) for name in FIGURES}


@pytest.fixture
def pretended(tmp_path, monkeypatch):
    """In an empty folder: a full run whose verdicts are given, whose figures are empty and which trains nothing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(figures, "FIGURES", with_arrays(lambda experiment: {}))
    monkeypatch.setattr(figure, "save", lambda name, data, folder, caption, is_smoke, figures: [])
    monkeypatch.setattr(page, "write_page", lambda folder, found, figures: folder / "report.html")

    def run(*arguments, **verdicts):
        records = [
            {
                "id": claim.id,
                "expected": claim.expected,
                "verdict": verdicts.get(claim.id, claim.expected),
                "value": 1.0,
                "close_calls": list(claim.close_calls),
            }
            | {key: "words" for key in ("sentence", "section", "figure", "statistic", "tolerance", "finding")}
            for claim in claims.CLAIMS
        ]
        monkeypatch.setattr(claims, "judge", lambda all_of_them, experiment: records)
        return main(["--cache", str(tmp_path / "cache"), *arguments])

    return run


def test_exit_code_is_0_as_expected_and_1_when_a_verdict_changed(pretended, tmp_path, capsys):
    assert pretended() == 0 and (tmp_path / "figures" / "results.json").is_file()
    assert "changed" not in capsys.readouterr().out
    assert pretended(C2="not reproduced", C6="reproduced") == 1
    assert capsys.readouterr().out.splitlines()[-1] == "Verdicts that changed: C2, C6"
    assert pretended(C4="partly", C5="reproduced") == 0, "a close call may fall to either side"
    assert pretended("--budget", "smoke", C2="not reproduced") == 0, "a smoke run has no expected verdicts"
    assert (tmp_path / "smoke" / "results.json").is_file()


def test_figures_that_need_no_training_are_drawn_once_and_before_any_claim_is_judged(pretended, tmp_path, monkeypatch, capsys):
    events = []
    monkeypatch.setattr(figure, "save", lambda name, *others, figures: events.append(name))
    pretended()  # sets what judges; then:
    judge = claims.judge
    monkeypatch.setattr(claims, "judge", lambda *arguments: events.append("judged") or judge(*arguments))
    del events[:]
    assert main(["--cache", str(tmp_path / "cache")]) == 0
    early = [name for name in FIGURES if not FIGURES[name].needs_training]
    assert events == [*early, "judged", *(name for name in FIGURES if name not in early)]
    del events[:]
    capsys.readouterr()
    assert main(["--cache", str(tmp_path / "cache"), "--only", "fig03"]) == 0
    assert events == ["fig03_enhancer"] and "before any training" not in capsys.readouterr().out


def test_a_stage_that_fails_leaves_the_early_figures_whole_and_nothing_else(tmp_path, monkeypatch, capsys):
    def fails(all_of_them, experiment):
        raise MemoryError("no more")

    monkeypatch.setattr(claims, "judge", fails)
    assert main(["--budget", "smoke", "--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"), "--arrays"]) == 2
    early = [name for name in FIGURES if not FIGURES[name].needs_training]
    assert f"figures {command.figure_numbers(early)} drawn" in capsys.readouterr().out
    expected = {f"{name}.{kind}" for name in early for kind in ("png", "svg", "npz")}
    assert {file.name for file in (tmp_path / "out").iterdir()} == expected
    assert [stage.name.split("-")[0] for stage in (tmp_path / "cache").iterdir()] == ["telemetry"]


@pytest.mark.parametrize(("names", "words"), [([*FIGURES][1:2], "2"), ([*FIGURES][:2], "1 and 2"), ([*FIGURES][8:11], "9, 10 and 11")])
def test_figures_are_listed_in_words(names, words):
    assert command.figure_numbers(names) == words


def test_the_time_of_figures_is_that_of_drawing_alone(pretended, tmp_path, monkeypatch, capsys):
    clock = SimpleNamespace(now=0.0, perf_counter=lambda: clock.now)

    def takes(seconds, gives):
        def work(*arguments, **options):
            clock.now += seconds
            return gives

        return work

    monkeypatch.setattr(command, "time", clock)
    monkeypatch.setattr(figures, "FIGURES", with_arrays(takes(100, {})))  # stages that are still to be done
    monkeypatch.setattr(figure, "save", takes(2, []))
    assert pretended("--only", "fig04") == 0
    assert capsys.readouterr().out.splitlines()[0].split() == ["figures", "2.0", "s"]
    pretended()
    assert _results(tmp_path / "figures")["timings"]["figures"] == 2 * len(FIGURES)


def test_the_captions_say_commands_that_draw_the_same_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = []
    monkeypatch.setattr(figures, "FIGURES", with_arrays(lambda experiment: {}))
    monkeypatch.setattr(figure, "save", lambda name, data, folder, caption, is_smoke, figures: said.append(caption))
    Path("my data").mkdir()
    values = np.sin(np.arange(2_000) / 15) + 0.1 * np.random.default_rng(0).standard_normal(2_000)
    pd.DataFrame({"t": np.arange(2_000), "volts, raw": values, "b": 0.0}).to_csv("my data/x.csv", index=False)
    real = ["--telemetry", str(tmp_path / "my data" / "x.csv"), "--column", "volts, raw", "--time", "t"]
    for given, means in {
        "": (),
        "--budget smoke --seed 3": ("--budget", "smoke", "--seed", "3"),
        "--telemetry 'my data/x.csv' --column 'volts, raw' --time t": real,
    }.items():
        assert main(["--out", "out", "--cache", "cache", "--only", "fig02_source_target", *means]) == 0
        line = said.pop()
        assert line.split(" · ")[2] == " ".join(["python -m enhsim_tf.reproduce", given, "--only fig02"]).replace("  ", " ")
        again, first = (parse(words) for words in (shlex.split(line.split(" · ")[2])[3:], ["--only", "fig02", *means]))
        assert Path(again.telemetry or ".").resolve() == Path(first.telemetry or ".").resolve()
        assert {**vars(again), "telemetry": None} == {**vars(first), "telemetry": None}
