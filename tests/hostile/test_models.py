"""A malicious model cannot run code or allocate more memory than its files justify. All checksums are correct, as an attacker would make them."""

import io
import json
import os
import pickle
import zipfile

import numpy as np
import pytest

from enhsim_tf.datasets.mix import Mix
from enhsim_tf.datasets.plan import make_plan
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.sources import read_source
from tests.hostile.folders import arrays_of_model, npz_of, saved_model, write_model


def test_the_model_as_it_was_written_loads(tmp_path):
    model = write_model(tmp_path / "model")
    assert EnhancedSimulator.load(model).generate(2).shape == (2, 24, 1) and make_plan(Mix(), model, 0, 5).window == 24


class Payload:
    """Creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_pickled_objects_do_not_run(tmp_path, refused):
    ran = str(tmp_path / "ran")
    content = pickle.dumps(Payload(ran))
    pickle.loads(content).close()  # unprotected, it runs
    np.save(tmp_path / "objects.npy", np.array([Payload(ran)] * 3, object), allow_pickle=True)
    model = write_model(tmp_path / "model", arrays_npz=npz_of(arrays_of_model() | {"enhancer/kernel_0": np.array([Payload(ran)], object)}))
    (tmp_path / "plain.npy").write_bytes(content)
    os.remove(ran)
    for name in ("plain.npy", "objects.npy"):
        with refused(name):
            read_source(tmp_path / name)
    with refused("arrays"):
        EnhancedSimulator.load(model)
    assert not os.path.exists(ran)


def header(shape):
    """A `.npy` file that declares the shape and holds nothing."""
    sink = io.BytesIO()
    np.lib.format.write_array_header_1_0(sink, {"descr": "<f4", "fortran_order": False, "shape": shape})
    return sink.getvalue()


def archive(member, compression=zipfile.ZIP_STORED):
    sink = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(saved_model()["arrays.npz"])) as before, zipfile.ZipFile(sink, "w", compression) as after:
        for name in before.namelist():
            after.writestr(name, member if name == "enhancer/kernel_0.npy" else before.read(name))
    return sink.getvalue()


@pytest.mark.parametrize("shape", [(10**9, 10**9), (24, 10**9), (10**12,), (-1, 4)])
def test_a_header_that_declares_more_than_there_is_is_refused(tmp_path, refused, shape):
    with refused("arrays"):
        EnhancedSimulator.load(write_model(tmp_path / "model", arrays_npz=archive(header(shape))))


def test_a_compressed_bomb_is_refused(tmp_path, refused):
    content = archive(header((24, 3 * 10**6)) + bytes(4 * 24 * 3 * 10**6), zipfile.ZIP_DEFLATED)
    assert len(content) < 10**6
    with refused("bytes of arrays"):
        EnhancedSimulator.load(write_model(tmp_path / "model", arrays_npz=content))


KERNEL, LAST, FACTOR, STARTS = "enhancer/kernel_0", "enhancer/kernel_2", "enhancer/factor_0", "noise/starts"
NAN = np.full((24, 8), np.nan, np.float32)


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: {KERNEL: np.zeros((24, 5), np.float32)},
        lambda arrays: {KERNEL: NAN},
        lambda arrays: {LAST: np.zeros((4, 23), np.float32), "enhancer/bias_2": np.zeros(23, np.float32)},
        lambda arrays: {FACTOR: np.zeros((24, 4), np.float32)},
        lambda arrays: {f"enhancer/{kind}_{number}": np.zeros((1, 1), np.float32) for kind in ("kernel", "bias") for number in range(500)},
        lambda arrays: {"enhancer/column": np.array([1]), "enhancer/gain": np.ones(1, np.float32)},
        lambda arrays: {"noise/windows": np.full((5, 24, 1), np.nan, np.float32)},
        lambda arrays: {"noise/windows": np.zeros((5, 23, 1), np.float32)},
        lambda arrays: {STARTS: np.arange(4)},
        lambda arrays: {"levels/rows": np.full((3, 1, 2), np.inf)},
        lambda arrays: {"alignment/waveform_0": np.zeros((400, 23), np.float32)},
    ],
)
def test_arrays_that_are_no_model_are_refused(tmp_path, refused, change):
    arrays = arrays_of_model()
    with refused("arrays and settings of a model"):
        EnhancedSimulator.load(write_model(tmp_path / "model", arrays_npz=npz_of(arrays | change(arrays))))


@pytest.mark.parametrize("name", [KERNEL, "enhancer/bias_1", "enhancer/centre", "enhancer/factor_1", "noise/windows", "levels/rows"])
def test_a_missing_array_is_refused(tmp_path, refused, name):
    arrays = arrays_of_model()
    del arrays[name]
    with refused("arrays and settings of a model"):
        EnhancedSimulator.load(write_model(tmp_path / "model", arrays_npz=npz_of(arrays)))


SETTINGS = json.loads(saved_model()["settings.json"])


@pytest.mark.parametrize(
    "change",
    [
        {"alignment": {"kind": "magic"}},
        {"alignment": SETTINGS["alignment"] | {"simulators": []}},
        {"channels": ["telemetry", "other"]},
        {"window": 23},
        {"interval_s": 0},
        {"enhancer": SETTINGS["enhancer"] | {"columns": 2}},
        {"noise": {"kind": "pink"}},
        {"quantisation": []},
        {"quantisation": [{"step": 0.0, "origin": 0.0, "count": 2}]},
        {"nominal": {"start": None, "offsets_s": [0.0]}},
        {"trained": [1]},
    ],
    ids=str,
)
def test_settings_that_are_no_model_are_refused(tmp_path, refused, change):
    settings = json.dumps(SETTINGS | change).encode()
    with refused("settings"):
        EnhancedSimulator.load(write_model(tmp_path / "model", settings_json=settings))
