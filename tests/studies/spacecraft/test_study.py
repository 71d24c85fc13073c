"""The command of the study on a small data set whose channels are known, and the published findings."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS
from studies.spacecraft import summary, training_data
from studies.spacecraft.__main__ import command
from studies.spacecraft.enhancement import METHODS
from studies.spacecraft.figure import FIGURES
from studies.spacecraft.reference import BOUNDS, NETWORK, REFERENCE, RIDGE
from studies.spacecraft.summary import KEPT, summarise
from studies.spacecraft.training_data import TRAINING

PUBLISHED = Path(summary.__file__).with_name("results")
SEQUENCES = {"W-1": [[900, 1099]], "W-2": [[400, 459], [1200, 1259]]}
NUM_SAMPLES = 1_800  # of a test part


def wave(number, seed):
    rng, at = np.random.default_rng(seed), np.arange(number)
    return np.sin(2 * np.pi * at / 50) + 0.3 * np.sin(6 * np.pi * at / 50) + 0.05 * rng.standard_normal(number)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two waves that stand still at the labelled samples, far outside their range, and a constant channel that cannot be used."""
    folder = tmp_path_factory.mktemp("data")
    for part in ("train", "test"):
        (folder / part).mkdir()
        np.save(folder / part / "flat.npy", np.ones((1_500, 2)))
    for seed, (name, sequences) in enumerate(SEQUENCES.items()):
        test = wave(NUM_SAMPLES, 10 + seed)
        for first, last in sequences:
            test[first : last + 1] = 4.0
        np.save(folder / "train" / f"{name}.npy", np.stack([wave(1_500, seed), np.zeros(1_500)], axis=1))
        np.save(folder / "test" / f"{name}.npy", np.stack([test, np.zeros(NUM_SAMPLES)], axis=1))
    rows = [f'{name},SMAP,"{each}","{["point"] * len(each)}",{NUM_SAMPLES}' for name, each in (*SEQUENCES.items(), ("flat", [[10, 20]]))]
    (folder / "labeled_anomalies.csv").write_text("chan_id,spacecraft,anomaly_sequences,class,num_values\n" + "\n".join(rows) + "\n")
    return folder


@pytest.fixture(scope="module")
def results(data, narrow_enhancer, tmp_path_factory):
    """Tables and findings of a smoke run, with the detectors whose training is quick and noise that diverges."""

    def diverge(*_):
        raise InputError("Expected noise that does not diverge. Received: NaN. Fit it again.")

    folder = tmp_path_factory.mktemp("out")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_data, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual")})
        patch.setattr(training_data.GaussianAutoregression, "fit", diverge)
        assert command(["--budget", "smoke", "--data", str(data), "--out", str(folder), "--cache", str(folder / "cache")]) == 0
    assert all((folder / f"{name}.png").is_file() for name in FIGURES)
    return KEPT.read(folder), json.loads((folder / "findings.json").read_text())


@pytest.mark.slow
def test_every_training_data_that_can_be_made_has_a_row_for_every_detector(results):
    tables, found = results
    assert list(found["channels"]) == list(SEQUENCES) and "constant" in found["skipped"]["flat"]
    assert set(found["sources"]) == set(TRAINING) - {"enhanced + AR"}
    assert all(set(each["by_detector"]) == {"limit check", "PCA residual"} for each in found["sources"].values())
    assert set(found["references"]) == {name + ending for name in (NETWORK, RIDGE) for ending in BOUNDS}
    assert set(found["controls"]) == set(summary.CONTROLS) and set(tables["enhancement"]["method"]) == set(METHODS)


@pytest.mark.slow
def test_no_window_with_a_labelled_sample_counts_as_nominal(results):
    tables, found = results
    for name, sequences in SEQUENCES.items():
        window = int(tables["channels"].query("channel == @name")["window"].iloc[0])
        begins = range(0, NUM_SAMPLES - window + 1, window // 8)
        nominal = [begin for begin in begins if all(begin > last or begin + window <= first for first, last in sequences)]
        assert found["channels"][name]["num_nominal"] == len(nominal) > 10


@pytest.mark.slow
def test_a_value_far_outside_is_found_by_the_limit_check_and_by_the_reference(results):
    _, found = results
    for each in (found["controls"]["limit check"], found["references"][RIDGE]):
        assert set(each["found"].values()) == {1.0} and each["auc_pr"]["mean"] > 0.8


@pytest.mark.slow
def test_regression_on_a_wave_that_follows_its_clock_is_as_near_as_the_noise_allows(results):
    _, found = results
    of_noise = 0.05 / np.sqrt(0.5 * (1 + 0.3**2))
    for each in found["channels"].values():
        assert of_noise < each["nrmse"]["ridge"] < 2 * of_noise < each["nrmse"]["coarse"] / 2


def test_the_summary_takes_means_over_channels_seeds_and_detectors():
    rows = [
        {"channel": channel, "seed": seed, "training": REFERENCE, "detector": "residual", "false_alarms": alarms, "auc_pr": alarms}
        | {"false_alarms_past": 0.0, "found_at_0.01": found, "found_at_0.05": 2, "found_at_0.1": 2, "sequences": 2}
        for channel, seed, alarms, found in (
            ("a", 0, 0.0, 2),
            ("a", 1, 0.2, 1),
            ("b", 0, 0.5, 0),
            ("b", 1, 0.5, 1),
            ("c", 0, 0.9, 2),
            ("c", 1, 0.7, 0),
        )
    ]
    found = summary._results(pd.DataFrame(rows))
    assert found["median_false_alarms"] == pytest.approx(0.5) and found["false_alarms"]["mean"] == pytest.approx(2.8 / 6)
    assert found["found"] == {"0.01": pytest.approx(6 / 12), "0.05": 1.0, "0.1": 1.0}


def test_the_published_findings_are_those_of_the_published_tables(near):
    kept = json.loads((PUBLISHED / "findings.json").read_text())
    again = json.loads(json.dumps(summarise(KEPT.read(PUBLISHED))))
    assert again == near({key: kept[key] for key in again}) and kept["budget"] == "full"


def test_the_readme_has_the_numbers_of_the_findings(numbers_of):
    rows, found = numbers_of("spacecraft"), json.loads((PUBLISHED / "findings.json").read_text())
    results = found["references"] | found["controls"] | found["sources"]
    shown = [name for name in results if name in rows]
    assert len(shown) == 11
    for name in shown:
        about = results[name]
        values = [about["auc_pr"]["mean"], 100 * about["false_alarms"]["mean"], 100 * about["found"]["0.01"]]
        assert rows[name][:1] == pytest.approx(values[:1], abs=0.0051) and rows[name][1:] == pytest.approx(values[1:], abs=0.51), name


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ([], "--data"),
        (["--data", "nowhere"], "nowhere"),
        (["--data", "nowhere", "--seeds", "0"], "--seeds"),
        (["--data", "{data}", "--channels", "W-9"], "'W-9'"),
    ],
)
def test_wrong_options_are_refused_in_one_line(given, word, data, tmp_path, capsys):
    given = [each.format(data=data) for each in given]
    assert command([*given, "--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: Expected") and word in line
