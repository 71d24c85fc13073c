"""The command of the study on a small data set whose channels are known."""

import json

import numpy as np
import pytest

from enhsim_tf.telemetry.series import Telemetry
from studies.common.detectors import DETECTORS
from studies.spacecraft import summary, training_data
from studies.spacecraft.__main__ import command
from studies.spacecraft.channel import stretches
from studies.spacecraft.reference import BOUNDS, NETWORK, RIDGE
from studies.spacecraft.summary import KEPT
from studies.spacecraft.telemanom import LabelledChannel

SEQUENCES = {"W-1": [[900, 1099]], "W-2": [[400, 459], [1200, 1259]]}
NUM_SAMPLES = 1_800  # of a test part


def wave(number, seed):
    rng, at = np.random.default_rng(seed), np.arange(number)
    return (
        np.sin(2 * np.pi * at / 50)
        + 0.3 * np.sin(6 * np.pi * at / 50)
        + 0.05 * rng.standard_normal(number)
    )


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
        np.save(
            folder / "train" / f"{name}.npy", np.stack([wave(1_500, seed), np.zeros(1_500)], axis=1)
        )
        np.save(folder / "test" / f"{name}.npy", np.stack([test, np.zeros(NUM_SAMPLES)], axis=1))
    rows = [
        f'{name},SMAP,"{each}","{["point"] * len(each)}",{NUM_SAMPLES}'
        for name, each in (*SEQUENCES.items(), ("flat", [[10, 20]]))
    ]
    (folder / "labeled_anomalies.csv").write_text(
        "chan_id,spacecraft,anomaly_sequences,class,num_values\n" + "\n".join(rows) + "\n"
    )
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("narrow_enhancer")
def test_every_training_data_that_can_be_made_has_a_row_for_every_detector(
    data, tmp_path, monkeypatch
):
    monkeypatch.setattr(
        training_data,
        "DETECTORS",
        {name: DETECTORS[name] for name in ("limit check", "PCA residual")},
    )
    assert (
        command(
            [
                "--budget",
                "smoke",
                "--data",
                str(data),
                "--out",
                str(tmp_path),
                "--cache",
                str(tmp_path / "cache"),
            ]
        )
        == 0
    )
    tables, found = KEPT.read(tmp_path), json.loads((tmp_path / "findings.json").read_text())
    assert list(found["channels"]) == list(SEQUENCES) and "constant" in found["skipped"]["flat"]
    assert set(found["sources"]) == {
        "real",
        "enhanced + GAN",
        "enhanced + bootstrap",
        "ridge + residual windows",
    }
    assert all(
        set(each["by_detector"]) == {"limit check", "PCA residual"}
        for each in found["sources"].values()
    )
    assert set(found["references"]) == {
        name + ending for name in (NETWORK, RIDGE) for ending in BOUNDS
    }
    assert set(found["controls"]) == set(summary.CONTROLS) and set(
        tables["enhancement"]["method"]
    ) == {"coarse", "ridge", "enhanced"}
    for each in (
        found["controls"]["limit check"],
        found["references"][RIDGE],
    ):  # a value far outside is found
        assert set(each["found"].values()) == {1.0} and each["auc_pr"]["mean"] > 0.8
    of_noise = 0.05 / np.sqrt(0.5 * (1 + 0.3**2))
    for each in found["channels"].values():  # regression is as near as the noise allows
        assert of_noise < each["nrmse"]["ridge"] < 2 * of_noise < each["nrmse"]["coarse"] / 2


def test_an_unknown_channel_is_refused(data, tmp_path, capsys):
    assert (
        command(
            [
                "--data",
                str(data),
                "--channels",
                "W-9",
                "--out",
                str(tmp_path),
                "--cache",
                str(tmp_path),
            ]
        )
        == 2
    )
    assert "Received: 'W-9'" in capsys.readouterr().err


def test_stretches_of_the_pictured_channel_have_the_anomaly_in_their_middle_and_the_signal_elsewhere():
    signal = np.sin(2 * np.pi * np.arange(8_000) / 97) + 0.01 * np.random.default_rng(
        0
    ).standard_normal(8_000)
    stuck = signal - 0.5
    stuck[4_000:4_060] = 0
    channel = LabelledChannel(
        "x",
        Telemetry(signal[:2_700].astype(np.float32)),
        Telemetry(stuck.astype(np.float32)),
        ((4_000, 4_060),),
    )
    found = stretches(channel)
    assert found["anomaly"] == (4_000, 4_060)
    samples, telemetry, enhanced = found["labelled as anomalous"]
    assert samples[0] + samples[-1] == pytest.approx(2 * 4_030, abs=2) and np.array_equal(
        telemetry, channel.test.values[samples]
    )
    _, telemetry, enhanced = found["later"]
    assert (
        np.std(telemetry - enhanced) < 0.05
    )  # the noise has 0.01, the level is half a unit lower than what was learnt
