"""Labelled data: a small data set with every oddity of the published file."""

import numpy as np
import pytest

from studies.public_benchmarks.telemanom import LABELS, load_channel, read_labels

HEADER = "chan_id,spacecraft,anomaly_sequences,class,num_values"
ROWS = [
    'A-1,SMAP,"[[10, 19]]",[point],100',
    'B-2,SMAP,"[[70, 79], [5, 5]]","[contextual, point]",100',
    'C-3,MSL,"[[0, 99]]",[contextual],100',
    # the published file lists a channel twice, too
    'A-1,SMAP,"[[15, 29], [30, 31], [50, 51]]","[contextual, point]",100',
    "D-4,MSL,[],[],100",
]


@pytest.fixture
def make(tmp_path):
    """Writes a data set with the given lines of labels and returns its folder."""

    def make(rows=ROWS, header=HEADER, num_test=100):
        for part, number in (("train", 40), ("test", num_test)):
            (tmp_path / part).mkdir(exist_ok=True)
            for channel in ("A-1", "B-2", "C-3", "D-4"):
                np.save(
                    tmp_path / part / f"{channel}.npy", np.arange(number)[:, None] / [100, 1, 1]
                )
        (tmp_path / "labeled_anomalies.csv").write_text("\n".join([header, *rows]) + "\n")
        return tmp_path

    return make


def test_sequences_that_share_a_sample_are_joined_and_neighbours_are_not(make):
    assert read_labels(make()) == {
        "A-1": ((10, 30), (30, 32), (50, 52)),
        "B-2": ((5, 6), (70, 80)),
        "C-3": ((0, 100),),
        "D-4": (),
    }
    assert read_labels(make(['C-3,"[(3, 4)]"', ""], header="\ufeffchan_id,anomaly_sequences")) == {
        "C-3": ((3, 5),)
    }


def load(channel, folder):
    return load_channel(folder, channel, read_labels(folder)[channel])


def test_channels_by_hand(make):
    folder = make()
    train, test, sequences = load("B-2", folder)
    np.testing.assert_array_equal(train[:, 0], np.float32(np.arange(40) / 100))
    assert test.shape == (100, 1)
    # the file's ends are inside
    assert sequences == ((5, 6), (70, 80))
    np.save(folder / "test" / "C-3.npy", np.arange(60))  # no commands, and shorter than its label
    _, test, sequences = load("C-3", folder)
    assert sequences == ((0, 60),) and test[:, 0].tolist() == list(range(60))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("A-1,SMAP,often,[point],100", "'often' of A-1"),
        ('A-1,SMAP,"[[9, 3]]",[point],100', "[[9, 3]]"),
        ('A-1,SMAP,"[[1.5, 3]]",[point],100', "1.5"),
        ('../A-1,SMAP,"[[1, 2]]",[point],100', "'../A-1'"),
    ],
)
def test_a_bad_row_is_named(make, refused, row, words):
    with refused(words, LABELS):
        read_labels(make([ROWS[1], row]))


def test_a_bad_folder_is_refused(make, tmp_path, refused):
    with refused("train/, test/", "No such file"):
        read_labels(tmp_path / "nowhere")
    with refused("chan_id"):
        read_labels(make(header="channel,spacecraft,anomaly_sequences,class,num_values"))
    with refused("labelled channels"):
        read_labels(make([]))
    with refused("60 samples", "sample 70 of B-2"):
        load("B-2", make(num_test=60))
    np.save(tmp_path / "test" / "B-2.npy", np.where(np.eye(100) == 1, np.inf, 0))
    with refused("finite", "B-2.npy"):
        load("B-2", tmp_path)
    (tmp_path / "test" / "B-2.npy").unlink()
    with refused("B-2.npy"):
        load("B-2", tmp_path)
