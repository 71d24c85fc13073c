"""The study of labelled telemetry, run as a user does on a small data set whose channels are known."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from enhsim_tf.reproduce.publish.report import findings_of

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.reproduce.__main__ import main
from studies.spacecraft import study
from studies.spacecraft.enhancement import METHODS
from studies.spacecraft.figures import FIGURES
from studies.spacecraft.findings import CONTROLS, KEPT, summarise
from studies.spacecraft.rates import rates_of
from studies.spacecraft.run import table
from studies.spacecraft.study import ARMS, DEGRADED_ARM, GENERATED_ARM

ROOT = Path(__file__).parents[3]
SEQUENCES = {"W-1": [[900, 1099]], "W-2": [[400, 459], [1200, 1259]]}


def wave(number, seed):
    rng, at = np.random.default_rng(seed), np.arange(number)
    return np.sin(2 * np.pi * at / 50) + 0.3 * np.sin(6 * np.pi * at / 50) + 0.05 * rng.standard_normal(number)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two waves, with what stands still or leaps at the labelled samples, and a constant channel that cannot be used."""
    folder = tmp_path_factory.mktemp("labelled")
    for part in ("train", "test"):
        (folder / part).mkdir()
    for seed, name in enumerate(SEQUENCES):
        test = wave(1_800, 10 + seed)
        for first, last in SEQUENCES[name]:
            test[first : last + 1] = 4.0
        np.save(folder / "train" / f"{name}.npy", np.stack([wave(1_500, seed), np.zeros(1_500)], axis=1))
        np.save(folder / "test" / f"{name}.npy", np.stack([test, np.zeros(1_800)], axis=1))
    for part in ("train", "test"):
        np.save(folder / part / "flat.npy", np.ones((1_500, 2)))
    rows = [f'{name},SMAP,"{sequences}","{["point"] * len(sequences)}",1800' for name, sequences in SEQUENCES.items()]
    rows.append('flat,SMAP,"[[10, 20]]","[point]",1500')
    (folder / "labeled_anomalies.csv").write_text("chan_id,spacecraft,anomaly_sequences,class,num_values\n" + "\n".join(rows) + "\n")
    return folder


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("stages")


@pytest.fixture(scope="module", autouse=True)
def quick_detectors():
    """Leaves out the detectors whose training takes seconds; tests of their own package cover them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual", "nearest neighbours")})
        yield


@pytest.fixture(scope="module")
def out(data, cache, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    command = ["--budget", "smoke", "--experiment", "labelled", "--data", str(data), "--out", str(folder), "--cache", str(cache)]
    assert main(command) == 0
    return folder / "labelled"


@pytest.fixture(scope="module")
def found(out):
    return json.loads((out / "findings.json").read_text())


def test_every_table_has_every_row(out):
    tables = KEPT.read(out)
    by = tables["thresholds"].groupby(["channel", "seed"])
    assert sorted(by.groups) == [(name, 0) for name in SEQUENCES]
    assert all(set(each) == {*ARMS, DEGRADED_ARM} for each in by["arm"].unique())
    assert (by.size() == by.size().iloc[0]).all()
    counts = tables["sequences"].drop_duplicates(["channel", "sequence"]).groupby("channel").size()
    assert counts.to_dict() == {name: len(sequences) for name, sequences in SEQUENCES.items()}
    assert set(tables["enhancement"]["method"]) == set(METHODS)


def test_no_window_with_a_labelled_sample_counts_as_nominal(out):
    tables = KEPT.read(out)
    rates = rates_of(tables)
    for name, sequences in SEQUENCES.items():
        about = tables["channels"][tables["channels"]["channel"] == name].iloc[0]
        window, stride = int(about["window"]), int(about["stride"])
        assert stride == window // 8
        begins = range(0, 1_800 - window + 1, stride)
        nominal = [begin for begin in begins if all(begin > last or begin + window <= first for first, last in sequences)]
        assert rates.num_nominal[name] == len(nominal) > 10


def test_a_value_far_outside_is_found_by_the_limit_check_at_its_first_window(out, found):
    control = found["controls"]["limit check"]
    assert control["found"]["mean"] == 1 and [each["mean"] for each in control["matched"]] == [1, 1, 1]
    assert control["median_delay"] <= 100 // 8 + 1, "a window is scored every eighth of its length"


def test_a_perfect_score_is_perfect_and_a_random_one_alarms_at_its_rate(out, found):
    assert found["oracle"]["auc_pr"] == pytest.approx(1.0) and found["oracle"]["vus_pr"] == pytest.approx(1.0)
    cells = rates_of(KEPT.read(out)).cells.query("detector == 'random score'")
    # set for 1 % on 200 windows, on some 240 windows for each channel and seed: a mean above 8 % would be less likely than one in ten thousand
    assert len(cells) == 2 and cells["own"].mean() <= 0.08


def test_arms_alarm_as_their_scores_and_thresholds_say(out, found):
    tables = KEPT.read(out)
    chosen = "channel == 'W-1' and arm == @GENERATED_ARM and detector == 'PCA residual'"
    limit = tables["thresholds"].query(f"{chosen} and rule == 'own'")["rank"].item()
    rates = rates_of(tables)
    cell = rates.cells.query(chosen)["own"].item()
    ranks = tables["scores"].query(chosen)
    stride, window = (int(tables["channels"].iloc[0][column]) for column in ("stride", "window"))
    begins = ranks["place"].to_numpy() * stride
    first, last = SEQUENCES["W-1"][0]
    nominal = (begins > last) | (begins + window <= first)
    assert cell == pytest.approx((ranks["rank"].to_numpy()[nominal] > limit).mean())
    assert found["channels"]["W-1"]["false_alarms"][GENERATED_ARM]["PCA residual"] == pytest.approx(cell)


def test_a_second_seed_with_the_same_results_changes_no_mean_and_no_chance(out, found):
    tables = {name: pd.concat([table, table.assign(seed=1)], ignore_index=True) for name, table in KEPT.read(out).items()}
    again = summarise(tables)
    assert again["seeds"] == [0, 1] and again["num_sequences"] == found["num_sequences"]
    for arm, about in found["arms"].items():
        assert again["arms"][arm]["false_alarms"]["mean"] == pytest.approx(about["false_alarms"]["mean"])
        for one, other in zip(again["arms"][arm]["matched"], about["matched"], strict=True):
            assert (one["mean"], one["chance"]) == pytest.approx((other["mean"], other["chance"]))


def test_real_telemetry_sets_both_of_its_thresholds_by_cross_fitting(out):
    limits = KEPT.read(out)["thresholds"].query("arm == 'real'").pivot(index=["channel", "seed", "detector"], columns="rule", values="rank")
    assert (limits["own"] == limits["past"]).all()


def test_every_arm_and_control_has_finds_chance_and_p_values(found):
    for about in (*found["arms"].values(), *found["controls"].values()):
        assert [each["rate"] for each in about["matched"]] == found["rates"]
        for each in about["matched"]:
            assert 0 <= each["low"] <= each["mean"] <= each["high"] <= 1 and 0 <= each["chance"] <= 1 and 0 < each["p_value"] <= 1
    assert set(found["controls"]) == set(CONTROLS)
    pair = next(each for each in found["contrasts"] if each["second"] == "real")
    arms = found["arms"]
    difference = arms[pair["first"]]["false_alarms"]["mean"] - arms["real"]["false_alarms"]["mean"]
    assert pair["false_alarms"]["mean"] == pytest.approx(difference)


def test_a_channel_that_cannot_be_used_is_left_out_and_said_so(found):
    assert list(found["skipped"]) == ["flat"] and "constant" in found["skipped"]["flat"]


def test_an_arm_that_cannot_be_made_is_left_out_and_the_channel_stays(data, cache, out, found, tmp_path, monkeypatch, capsys):
    def diverge(self, folder):
        raise InputError("Expected finite noise. Received: noise that diverged. Fit it again.")

    monkeypatch.setattr(study.ChannelStudy, "_make_gan_noise", diverge)
    monkeypatch.setattr(
        study.GaussianAutoregression, "fit", lambda *_: SimpleNamespace(generate=lambda number, seed: np.full((number, 1), np.nan))
    )
    command = [
        "--budget",
        "smoke",
        "--experiment",
        "labelled",
        "--data",
        str(data),
        "--out",
        str(tmp_path),
        "--cache",
        str(tmp_path / "cache"),
    ]
    shutil.copytree(cache, tmp_path / "cache", ignore=lambda _, names: [name for name in names if name.startswith(("GAN", "study"))])
    assert main([*command, "--channels", "W-1"]) == 0
    said = capsys.readouterr().out
    assert (
        "enhanced + GAN             left out: Expected finite noise" in said
        and "enhanced + AR              left out: Expected a simul" in said
    )
    tables = KEPT.read(tmp_path / "labelled")
    assert set(tables["thresholds"]["arm"]) == {*ARMS, DEGRADED_ARM} - {"enhanced + GAN", "enhanced + AR"}
    less = json.loads((tmp_path / "labelled" / "findings.json").read_text())
    assert "enhanced + GAN" not in less["arms"] and "noise that diverged" in less["channels"]["W-1"]["dropped"][0]
    assert less["channels"]["W-1"]["false_alarms"]["coarse"] == found["channels"]["W-1"]["false_alarms"]["coarse"]
    assert "| W-1 |" in table(less) and "on generated" in table(less)
    # next to channels and seeds that have every arm, shares are those of the rows that have it
    whole = KEPT.read(out)
    second = {name: pd.concat([tables[name], each.query("channel == 'W-2'")]).assign(seed=1) for name, each in whole.items()}
    both = summarise({name: pd.concat([each, second[name]], ignore_index=True) for name, each in whole.items()})
    for one, other in zip(both["arms"]["enhanced + GAN"]["matched"], found["arms"]["enhanced + GAN"]["matched"], strict=True):
        assert (one["mean"], one["chance"]) == pytest.approx((other["mean"], other["chance"]))
    assert both["channels"]["W-1"]["dropped"] == less["channels"]["W-1"]["dropped"] and "dropped" not in both["channels"]["W-2"]


def test_findings_are_those_of_the_tables(out, found):
    again = json.loads(json.dumps(summarise(KEPT.read(out))))
    assert again == {key: found[key] for key in again}


def test_the_projects_report_and_page_are_those_of_its_tables(near):
    kept = findings_of(ROOT, "labelled")
    again = json.loads(json.dumps(summarise(KEPT.read(ROOT / "figures" / "labelled"))))
    assert again == near({key: kept[key] for key in again}) and kept["budget"] == "full"
    assert table(kept) in (ROOT / "docs" / "spacecraft.md").read_text(encoding="utf-8")


def test_figures_are_there(out):
    assert all((out / f"{name}.{suffix}").is_file() for name in FIGURES for suffix in ("png", "svg"))


def test_the_second_run_takes_every_channel_from_the_cache(data, cache, out, tmp_path, capsys):
    command = ["--budget", "smoke", "--experiment", "labelled", "--data", str(data), "--out", str(tmp_path), "--cache", str(cache)]
    assert main([*command, "--channels", "W-2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.endswith("...")] == [] and sum("(from the cache)" in line for line in lines) == 3
    kept = KEPT.read(out)["ranking"].query("channel == 'W-2'").reset_index(drop=True)
    pd.testing.assert_frame_equal(KEPT.read(tmp_path / "labelled")["ranking"], kept)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        (["--experiment", "labelled"], "--data"),
        (["--data", "x"], "--experiment labelled"),
        (["--channels", "A"], "--channels"),
        (["--experiment", "labelled", "--data", "nowhere"], "nowhere"),
        (["--experiment", "labelled", "--seeds", "3", "--data", "nowhere"], "--seeds"),
    ],
)
def test_wrong_options_are_refused_in_one_line(given, word, tmp_path, capsys):
    assert main([*given, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: Expected") and word in line
    assert not (tmp_path / "out").exists()


def test_an_unknown_channel_is_refused(data, cache, tmp_path, capsys):
    command = ["--budget", "smoke", "--experiment", "labelled", "--data", str(data), "--out", str(tmp_path), "--cache", str(cache)]
    assert main([*command, "--channels", "W-1,W-9"]) == 2
    assert "'W-9'" in capsys.readouterr().err


def test_missing_tables_are_refused(tmp_path):
    with pytest.raises(InputError, match="channels.parquet"):
        KEPT.read(tmp_path)
