"""Damaged files and models are refused in one line, and none can run code when it is read."""

import json
import os
import pickle
import re
import zipfile

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.cli.shared import channels_by_model
from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.sources import read_source
from tests.small_data_set import plain


@pytest.fixture
def model(tmp_path):
    plain(channels=("volts",)).save(tmp_path / "model")
    assert EnhancedSimulator.load(tmp_path / "model").channels == ("volts",)
    return tmp_path / "model"


def rewrite(path, change):
    path.write_bytes(change(path.read_bytes()))


def half(content):
    return content[: len(content) // 2]


def sign(model):
    """Writes the checksums of a model's files as they are now."""
    manifest = json.loads((model / "manifest.json").read_text())
    manifest["sha256"] = {name: sha256(model / name) for name in manifest["sha256"]}
    (model / "manifest.json").write_text(json.dumps(manifest))


MODELS = {
    "arrays cut off": ("arrays.npz", half, "missing or damaged file"),
    "settings by hand": (
        "settings.json",
        lambda content: content.replace(b"2.0", b"3.0"),
        "missing or damaged file",
    ),
    "settings cut off": ("settings.json", half, "missing or damaged file"),
    "another version": (
        "manifest.json",
        lambda content: re.sub(rb"Simulator/\d+", b"Simulator/4", content),
        "format 4",
    ),
    "another program": (
        "manifest.json",
        lambda content: b'{"name": "an app"}',
        "KeyError in manifest.json",
    ),
    "a list": ("manifest.json", lambda content: b"[1, 2]", "TypeError in manifest.json"),
    "manifest cut off": ("manifest.json", half, "JSONDecodeError in manifest.json"),
}


@pytest.mark.parametrize("damage", MODELS)
def test_a_damaged_model_is_refused(model, refused, damage):
    name, change, words = MODELS[damage]
    rewrite(model / name, change)
    with refused(words):
        EnhancedSimulator.load(model)


@pytest.mark.parametrize("name", ["arrays.npz", "settings.json", "manifest.json"])
def test_a_model_without_one_of_its_files_is_refused(model, refused, name):
    (model / name).unlink()
    with refused("model"):
        EnhancedSimulator.load(model)


def test_a_model_with_a_part_that_this_version_does_not_know_is_refused(model, refused):
    rewrite(
        model / "settings.json", lambda content: content.replace(b"WindowBootstrap", b"PinkNoise")
    )
    sign(model)
    with refused("'PinkNoise'", "Fit it again"):
        EnhancedSimulator.load(model)


@pytest.mark.parametrize(
    "content", [b"{", b"{}", b"\xff", b"[" * 100_000, b'{"channels": null}', b'{"channels": [3]}']
)
def test_a_model_without_names_of_channels_is_refused_before_it_is_loaded(model, refused, content):
    (model / "settings.json").write_bytes(content)
    with refused("settings.json"):
        channels_by_model(["volts"], {"volts": model})


TABLE = pd.DataFrame(
    {"time": pd.date_range("2024-01-01", periods=500, freq="s"), "volts": np.arange(500.0) % 7}
)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["a.npy", "a.parquet", "a.xlsx", "a.csv.gz", "a.zip"])
def test_a_source_that_is_cut_off_is_refused(tmp_path, refused, name):
    path = tmp_path / name
    if name == "a.npy":
        np.save(path, TABLE["volts"].to_numpy())
    elif name == "a.parquet":
        TABLE.to_parquet(path)
    elif name == "a.xlsx":
        pytest.importorskip("openpyxl")
        TABLE.to_excel(path, index=False)
    else:
        TABLE.to_csv(path if name == "a.csv.gz" else tmp_path / "a.csv", index=False)
    if name == "a.zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(tmp_path / "a.csv", "a.csv")
    assert list(read_source(path))
    rewrite(path, half)
    with refused(name, "cannot be read"):
        read_source(path)


class Payload:
    """Creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_pickled_objects_do_not_run(model, tmp_path, refused):
    ran = str(tmp_path / "ran")
    pickle.loads(pickle.dumps(Payload(ran))).close()  # unprotected, it runs
    os.remove(ran)
    objects = np.array([Payload(ran)] * 3, object)
    np.save(tmp_path / "objects.npy", objects, allow_pickle=True)
    (tmp_path / "plain.npy").write_bytes(pickle.dumps(Payload(ran)))
    for name in ("plain.npy", "objects.npy"):
        with refused(name):
            read_source(tmp_path / name)
    with np.load(model / "arrays.npz") as arrays:
        np.savez(model / "arrays.npz", **dict(arrays) | {"levels": objects})
    sign(model)
    with pytest.raises(ValueError, match="allow_pickle"):
        EnhancedSimulator.load(model)
    assert not os.path.exists(ran)
