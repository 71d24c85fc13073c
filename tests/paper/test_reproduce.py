import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf import reproduce
from enhsim_tf.paper.claims import CLAIMS, NOT_MEASURED, judge_all
from enhsim_tf.paper.figures import FIGURES, TRAINED, save_figure
from enhsim_tf.paper.telemetry import ParquetStore
from tests.clone import ROOT, answered
from tests.paper.conftest import TINY_OPTIONS, tiny_pipeline


@pytest.fixture(scope="module")
def ran(cache, pipeline, tmp_path_factory):
    """The command at the tiny size, which finds the stages of the pipeline in the cache."""
    judge_all(pipeline)
    out = tmp_path_factory.mktemp("out")
    code = reproduce.main(f"--budget smoke --cache {cache} --out {out}".split() + TINY_OPTIONS)
    return code, out, json.loads((out / "results.json").read_text())


@pytest.mark.slow
def test_every_figure_is_written_and_the_page_shows_it(ran):
    code, out, found = ran
    assert code == 0
    verdicts = [claim["verdict"] for claim in found["claims"]]
    assert [row["this run"] for row in found["box"]] == verdicts
    page = (out / "report.html").read_text()
    for name in FIGURES:
        assert (out / f"{name}.png").read_bytes()[:4] == b"\x89PNG"
        assert f'id="{name}"' in page and (out / f"{name}.svg").stat().st_size > 1_000
    assert not re.search(
        r"<script|https?://(?!arxiv\.org)[^\"]*\"", re.sub(r'src="data:[^"]*"', "", page)
    )


@pytest.mark.parametrize(
    ("given", "folder"),
    [
        ("", "figures"),
        ("--only fig04", "figures"),
        ("--seed 3", "figures_seed3"),
        ("--seed 3 --only fig04", "figures_seed3"),
        ("--set dropout=0", "figures_changed"),
        ("--budget smoke --seed 3", "smoke_seed3"),
        ("--seed 3 --out figures", "figures"),
    ],
)
def test_only_the_published_run_writes_to_the_figures_of_its_own_accord(given, folder):
    assert reproduce.choose_folder(reproduce.parse(given.split())) == Path(folder)


@pytest.mark.parametrize("out", [[], ["--out", "new"]])
def test_refused_telemetry_leaves_no_folder(out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = "--telemetry missing.csv --column volts --time utc --cache cache".split()
    assert reproduce.main(asked + out) == 2
    assert not list(tmp_path.iterdir())


def test_figures_that_a_run_draws_first_need_no_trained_network(tmp_path):
    pipeline = tiny_pipeline(tmp_path)
    for name in FIGURES:
        if name[:5] not in TRAINED:
            save_figure(name, pipeline, tmp_path, "")
    assert set(pipeline.stages.cached) <= {"telemetry"}


@pytest.mark.parametrize(
    ("arguments", "different", "code"),
    [("", ["C1: nrmse"], 1), ("", [], 0), ("--budget smoke", ["C1: nrmse"], 0)],
)
def test_the_exit_code_says_whether_a_measurement_lies_outside_its_published_range(
    arguments, different, code, capsys
):
    assert reproduce.conclude(reproduce.parse(arguments.split()), different) == code
    assert ("C1: nrmse" in capsys.readouterr().out) == (code == 1)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ("--help", 0),
        ("--seed -1", 2),
        ("--only fig99", 2),
        ("--cache README.md/below --out .", 2),
    ],
)
def test_answers_that_need_no_network_import_none(arguments, code):
    done = answered("enhsim_tf.reproduce", arguments.split())
    assert (done.returncode, done.stdout.splitlines()[-1]) == (code, "set()"), done.stderr


def test_control_characters_reach_neither_caption_nor_results():
    foot = reproduce.foot_of(
        reproduce.parse(["--telemetry", "a\x1b[31m\u202eb\nc.csv"]), "fig04_enhanced_simulation"
    )
    assert foot.isprintable() and "a?[31m?b?c.csv" in foot and foot.endswith("--only fig04")


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_channel_of_ones_own_keeps_its_times_and_is_scaled_by_its_square_wave(tmp_path, kind):
    times = np.datetime64("2021-03-04T05:06:07") + np.arange(4_000) * np.timedelta64(30, "s")
    values = np.sin(np.arange(4_000) / 15) + 0.1 * np.random.default_rng(0).standard_normal(4_000)
    table = pd.DataFrame({"utc": times, "volts": values, "amperes": 0.0})
    table.to_csv(tmp_path / "x.csv", index=False) if kind == "csv" else table.to_parquet(
        tmp_path / "x.parquet"
    )
    words = f"--telemetry {tmp_path}/x.{kind} --column volts --time utc --only fig14"
    assert reproduce.main(f"{words} --out {tmp_path}/out --cache {tmp_path}/cache".split()) == 0
    (folder,) = (tmp_path / "cache").iterdir()
    kept = ParquetStore(folder / "telemetry.parquet").read()
    assert (kept.start, kept.interval, len(kept.values)) == ("2021-03-04T05:06:07Z", 30, 4_000)
    # the pipeline's unit is that of the square wave
    slope, offset = np.polyfit(values, kept.values, 1)
    np.testing.assert_allclose(kept.values, slope * values + offset, atol=1e-5)


@pytest.mark.slow
def test_claims_that_need_the_true_signal_are_not_measured_on_a_channel_of_ones_own(tmp_path):
    noise = 0.1 * np.random.default_rng(0).standard_normal(4_000)
    np.save(tmp_path / "x.npy", np.sin(np.arange(4_000) / 15) + noise)
    words = f"--budget smoke --telemetry {tmp_path}/x.npy --out {tmp_path}/out --cache {tmp_path}/c"
    assert reproduce.main([*words.split(), *TINY_OPTIONS]) == 0
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    left = [claim["id"] for claim in found["claims"] if claim["verdict"] == NOT_MEASURED]
    assert left == ["C3", "C8", "C9"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "kept"),
    [
        ("enhancer", ["telemetry"]),
        ("noise GAN", ["telemetry", "enhancer", "enhancement"]),
    ],
)
def test_killed_in_training_the_next_run_continues_and_finds_the_same(
    pipeline, tmp_path, stage, kept
):
    out, cache = tmp_path / "out", tmp_path / "cache"
    words = f"-m enhsim_tf.reproduce --budget smoke --cache {cache} --out {out}".split()
    process = subprocess.Popen(
        [sys.executable, *words, *TINY_OPTIONS],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    for line in process.stdout:
        if line.startswith(stage):
            process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not list(cache.glob(f"{stage}-*")), "no part of the killed stage stands under its name"
    assert not (out / "results.json").exists()
    again = tiny_pipeline(cache)
    for claim in CLAIMS:
        if claim.id in ("C1", "C4", "C5", "C6"):  # of both networks
            assert claim.measure(again) == claim.measure(pipeline), (
                "to the last digit, in another cache"
            )
    assert [name for name, is_cached in again.stages.cached.items() if is_cached] == kept
