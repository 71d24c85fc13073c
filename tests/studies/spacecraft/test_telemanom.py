"""Tests of labelled data: a small data set with every oddity of the published file, and the published one if available."""

from pathlib import Path

import numpy as np
import pytest

from studies.spacecraft.telemanom import LABELS, load_channel, load_labelled, read_labels

SMAP = Path(__file__).parents[2] / ".." / "shared" / "data" / "smap"
HEADER = "chan_id,spacecraft,anomaly_sequences,class,num_values"
ROWS = [
    'A-1,SMAP,"[[10, 19]]",[point],100',
    'B-2,SMAP,"[[70, 79], [5, 5]]","[contextual, point]",100',
    'C-3,MSL,"[[0, 99]]",[contextual],100',
    'A-1,SMAP,"[[15, 29], [50, 51]]","[contextual, point]",100',  # the published file lists a channel twice, too
    "D-4,MSL,[],[],100",
]


@pytest.fixture
def make(tmp_path):
    """Writes a data set with the given lines of labels and returns its folder."""

    def make(rows=ROWS, header=HEADER, num_test=100, num_train=40, columns=4):
        for part, number in (("train", num_train), ("test", num_test)):
            (tmp_path / part).mkdir(exist_ok=True)
            for channel in ("A-1", "B-2", "C-3", "D-4"):
                array = np.zeros((number, columns))
                array[:, 0] = np.arange(number) / 100
                array[:, 1:] = np.arange(number)[:, None] % 2
                np.save(tmp_path / part / f"{channel}.npy", array)
        (tmp_path / "labeled_anomalies.csv").write_text("\n".join([header, *rows]) + "\n")
        return tmp_path

    return make


def test_labels_by_hand(make):
    labels = read_labels(make())
    assert list(labels) == ["A-1", "B-2", "C-3", "D-4"]
    assert labels["A-1"].sequences == ((10, 30), (50, 52)) and labels["A-1"].classes == ("point", "point")
    assert labels["B-2"].sequences == ((5, 6), (70, 80)) and labels["B-2"].classes == ("point", "contextual")
    assert labels["D-4"].sequences == () == labels["D-4"].classes
    assert [label.spacecraft for label in labels.values()] == ["SMAP", "SMAP", "MSL", "MSL"]
    assert list(read_labels(make(), spacecraft="msl")) == ["C-3", "D-4"]


def test_sequences_that_share_a_sample_are_joined_and_neighbours_are_not(make):
    (labels,) = read_labels(make(['E-5,SMAP,"[[20, 29], [10, 19], [12, 13]]","[b, a, c]",100'])).values()
    assert labels.sequences == ((10, 20), (20, 30)) and labels.classes == ("a", "b")


def test_channels_by_hand(make):
    folder = make()
    channel = load_channel(folder, "B-2")
    assert channel.train.values.tolist() == (np.arange(40, dtype=np.float32) / np.float32(100)).tolist()
    assert (len(channel.test), channel.test.name, channel.test.has_time) == (100, "B-2", False)
    assert channel.train_commands.shape == (40, 3) and set(channel.test_commands[1]) == {1}
    assert np.flatnonzero(channel.is_anomalous).tolist() == [5, *range(70, 80)], "the file's ends are inside"
    assert [one.labels.channel for one in load_labelled(folder)] == ["A-1", "B-2", "C-3", "D-4"]
    assert [one.labels.channel for one in load_labelled(folder, spacecraft="SMAP")] == ["A-1", "B-2"]
    assert [one.labels.channel for one in load_labelled(folder, channels=["D-4", "A-1"])] == ["A-1", "D-4"]


def test_other_shapes_of_the_layout(make):
    folder = make([row for row in ROWS if row.startswith("C-3")], num_test=60, columns=1)
    channel = load_channel(folder, "C-3")
    assert channel.labels.sequences == ((0, 60),) and channel.is_anomalous.all() and channel.test_commands.shape == (60, 0)
    np.save(folder / "test" / "C-3.npy", np.arange(7))
    assert load_channel(folder, "C-3").test.values.tolist() == list(range(7))
    make(['C-3,"[(3, 4)]"', ""], header="\ufeffchan_id,anomaly_sequences")
    (label,) = read_labels(folder).values()
    assert (label.sequences, label.classes, label.spacecraft) == (((3, 5),), ("",), "")


BAD_ROWS = {
    "a word for sequences": ("A-1,SMAP,often,[point],100", "'often' in line 3"),
    "code for sequences": ('A-1,SMAP,"__import__(1)",[point],100', "line 3"),
    "a sequence that ends before it begins": ('A-1,SMAP,"[[9, 3]]",[point],100', "[[9, 3]]"),
    "a sequence before the first sample": ('A-1,SMAP,"[[-3, 3]]",[point],100', "[[-3, 3]]"),
    "half a sample": ('A-1,SMAP,"[[1.5, 3]]",[point],100', "1.5"),
    "a class missing": ('A-1,SMAP,"[[1, 2], [4, 5]]",[point],100', "Received: 1 in line 3"),
    "a column missing": ('A-1,SMAP,"[[1, 2]]",[point]', "Received: 4 in line 3"),
    "sequences without quotes": ("A-1,SMAP,[[1, 2]],[point],100", "Received: 6 in line 3"),
    "no channel": (',SMAP,"[[1, 2]]",[point],100', "''"),
    "a channel outside": ('../A-1,SMAP,"[[1, 2]]",[point],100', "'../A-1'"),
    "two spacecraft": ('B-2,MSL,"[[1, 2]]",[point],100', "two for B-2"),
}


@pytest.mark.parametrize("name", BAD_ROWS)
def test_a_bad_row_is_named(make, refused, name):
    row, words = BAD_ROWS[name]
    folder = make([ROWS[1], row])
    with refused(words, "line 3"):
        read_labels(folder)


def test_a_bad_folder_is_refused(make, tmp_path, refused):
    with refused("train/, test/"):
        read_labels(tmp_path / "nowhere")
    with refused("chan_id"):
        read_labels(make(header="channel,spacecraft,anomaly_sequences,class,num_values"))
    (tmp_path / "labeled_anomalies.csv").write_bytes(b"")
    with refused("Received: none"):
        read_labels(tmp_path)
    folder = make()
    with refused("'Z-9'"):
        load_channel(folder, "Z-9")
    with refused("'Z-9'"):
        load_labelled(folder, channels=["Z-9"])
    with refused("MSL, SMAP", "'GRACE'"):
        read_labels(folder, spacecraft="GRACE")


@pytest.mark.parametrize("part", ["train", "test"])
def test_a_bad_array_is_refused(make, refused, part):
    folder = make()
    path = folder / part / "B-2.npy"
    for content, words in (
        (np.full((100, 4), np.nan), "sample 0"),
        (np.where(np.arange(400).reshape(100, 4) == 48, np.inf, 0), "inf at sample 12"),
        (np.zeros((100, 4, 2)), "(100, 4, 2)"),
        (np.zeros((0, 4)), "(0, 4)"),
        (np.array(["a"] * 100), "<U1"),
        (np.array(3.0), "shape ()"),
    ):
        np.save(path, content)
        with refused(words, f"{part}/B-2.npy"):
            load_channel(folder, "B-2")
    path.write_bytes(b"no array")
    with refused(f"{part}/B-2.npy"):
        load_channel(folder, "B-2")
    path.unlink()
    with refused(f"{part}/B-2.npy", "No such file"):
        load_channel(folder, "B-2")
    channels = load_labelled(folder)
    assert next(channels).labels.channel == "A-1", "the channels before it are loaded"


def test_a_label_beyond_the_array_is_refused(make, refused):
    with refused("60 samples", "[70, 80] of B-2"):
        load_channel(make(num_test=60), "B-2")


needs_smap = pytest.mark.skipif(not (SMAP / LABELS).is_file(), reason="needs ../shared/data/smap beside the repository")


@needs_smap
def test_the_published_channels():
    channels = {channel.labels.channel: channel for channel in load_labelled(SMAP, spacecraft="SMAP")}
    lengths = {name: int(channel.is_anomalous.sum()) for name, channel in channels.items()}
    assert lengths == {"P-3": 1_336, "A-2": 111, "A-3": 186, "G-1": 121, "T-1": 1_536, "T-3": 184}  # lengths as published
    for name, channel in channels.items():
        assert np.array_equal(channel.test.values, np.load(SMAP / "test" / f"{name}.npy")[:, 0].astype(np.float32))
        assert channel.train_commands.shape == (len(channel.train), 24)
    assert channels["T-1"].labels.classes == ("point", "contextual")


@needs_smap
def test_the_stuck_sequences_are_found_stuck():
    """Labels match the values: each of the three stuck anomalies contains the longest run of one value."""
    for name in ("A-2", "A-3", "G-1"):
        channel = load_channel(SMAP, name)
        ((start, stop),) = channel.labels.sequences
        values = channel.test.values
        begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1))
        lengths = np.diff(begins, append=len(values))
        first, second = np.argsort(-lengths)[:2]
        assert start <= begins[first] and begins[first] + lengths[first] <= stop, name
        assert lengths[first] > 3 * lengths[second], name
