"""A malicious model cannot run code or allocate more memory than its files justify. All checksums are correct, as an attacker would make them."""

import copy
import functools
import io
import json
import operator
import os
import pickle
import zipfile

import numpy as np
import pytest

from enhsim_tf.datasets.plan import make_plan
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.sources import read_source
from tests.hostile.folders import arrays_of_model, npz_of, saved_model, write_model

KERNEL, LAST, FACTOR, STARTS = "enhancer/layers/0/0", "enhancer/layers/2", "enhancer/factors/0", "noise/starts"
SETTINGS = json.loads(saved_model()["settings.json"])


def test_the_model_as_it_was_written_loads(tmp_path):
    model = write_model(tmp_path / "model")
    simulator = EnhancedSimulator.load(model)
    assert simulator.generate(2).shape == (2, 24, 1) and make_plan(simulator, model, (), 1.0, 5, 0).window == 24


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
    model = write_model(tmp_path / "model", arrays_npz=npz_of(arrays_of_model() | {KERNEL: np.array([Payload(ran)], object)}))
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
            after.writestr(name, member if name == f"{KERNEL}.npy" else before.read(name))
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


def with_part(*path, value):
    """The settings with another value at a path of names and numbers."""
    settings = copy.deepcopy(SETTINGS)
    *path, last = path
    functools.reduce(operator.getitem, path, settings)[last] = value
    return settings


def load(folder, settings=SETTINGS, **arrays):
    return EnhancedSimulator.load(
        write_model(folder / "model", settings_json=json.dumps(settings).encode(), arrays_npz=npz_of(arrays_of_model() | arrays))
    )


NAN = np.full((24, 8), np.nan, np.float32)
WAVE = ("alignment", "simulators", 0, "waves", 0)


@pytest.mark.parametrize(
    "arrays",
    [
        {KERNEL: np.zeros((24, 5), np.float32)},
        {KERNEL: NAN},
        {KERNEL: np.full((24, 8), "a")},
        {f"{LAST}/0": np.zeros((4, 23), np.float32), f"{LAST}/1": np.zeros(23, np.float32)},
        {FACTOR: np.zeros((24, 4), np.float32)},
        {"enhancer/bias": np.zeros(23, np.float32)},
        {f"enhancer/layers/{number}/{kind}": np.zeros((1, 1), np.float32) for kind in (0, 1) for number in range(500)},
        {"noise/windows": np.full((5, 24, 1), np.nan, np.float32)},
        {"noise/windows": np.zeros((5, 23, 1), np.float32)},
        {"noise/windows": np.zeros((5, 24), np.float32)},
        {"levels": np.full((3, 1, 2), np.inf)},
        {"levels": np.zeros((0, 1, 2))},
        {"of no part": np.zeros(1)},
    ],
)
def test_arrays_that_are_no_model_are_refused(tmp_path, refused, arrays):
    with refused("arrays and settings of a model"):
        load(tmp_path, **arrays)


ADDED = [
    (STARTS, np.arange(4), with_part("noise", "starts", value={"array": STARTS})),
    (STARTS, np.zeros(5), with_part("noise", "starts", value={"array": STARTS})),
    ("column", np.array([1]), with_part("enhancer", "main", value=[{"array": "column"}, 1.0])),
    ("wave", np.zeros((400, 23), np.float32), with_part("alignment", "waveforms", value=[{"array": "wave"}])),
    ("wave", np.zeros((500, 24), np.float32), with_part("alignment", "waveforms", value=[{"array": "wave"}])),
]


@pytest.mark.parametrize(("name", "array", "settings"), ADDED)
def test_an_added_array_that_does_not_fit_is_refused(tmp_path, refused, name, array, settings):
    with refused("arrays and settings of a model"):
        load(tmp_path, settings, **{name: array})


@pytest.mark.parametrize("name", [KERNEL, "enhancer/layers/1/1", "enhancer/centre", "enhancer/factors/1", "noise/windows", "levels"])
def test_a_missing_array_is_refused(tmp_path, refused, name):
    arrays = arrays_of_model()
    del arrays[name]
    with refused("arrays and settings of a model"):
        EnhancedSimulator.load(write_model(tmp_path / "model", arrays_npz=npz_of(arrays)))


LEVELS = {"kind": "Levels", "step": 1.0, "origin": 0.0, "count": 2}
RUN = {"kind": "Run", "values": {"array": "levels"}, "offset_s": 0.0}
RECORDING = {"kind": "Recording", "parts": [RUN], "columns": ["telemetry"], "interval_s": 2.0, "start": None, "name": "telemetry"}


@pytest.mark.parametrize(
    "settings",
    [
        SETTINGS | {"alignment": {"kind": "magic"}},
        SETTINGS | {"alignment": LEVELS},
        with_part("alignment", "simulators", value=[]),
        with_part("alignment", "simulators", value=[LEVELS]),
        with_part("alignment", "interval_s", value=1.0),
        with_part(*WAVE, "duty", value=1.0),
        with_part(*WAVE, "low", value=float("nan")),
        SETTINGS | {"channels": ["telemetry", "other"]},
        SETTINGS | {"channels": [5]},
        with_part("enhancer", "window", value=23),
        with_part("enhancer", "window", value=0),
        with_part("enhancer", "window", value="24"),
        with_part("enhancer", "columns", value=2),
        with_part("enhancer", "layers", value=[[{"array": KERNEL}, {"array": KERNEL}]]),
        SETTINGS | {"enhancer": None},
        SETTINGS | {"interval_s": 0},
        SETTINGS | {"interval_s": float("inf")},
        SETTINGS | {"level_step": -1},
        SETTINGS | {"levels": None},
        SETTINGS | {"noise": {"kind": "pink"}},
        SETTINGS | {"noise": LEVELS},
        SETTINGS | {"noise": {"kind": "GaussianNoise", "root": 1.0, "window": 10**12, "processes": []}},
        SETTINGS | {"noise": {"kind": "GaussianAutoregression", "coefficients": [], "innovation_sd": -1.0}},
        SETTINGS | {"quantisation": []},
        SETTINGS | {"quantisation": [LEVELS | {"step": 0.0}]},
        SETTINGS | {"quantisation": [LEVELS | {"origin": float("inf")}]},
        SETTINGS | {"quantisation": [LEVELS | {"other": 1}]},
        SETTINGS | {"nominal": 5},
        SETTINGS | {"nominal": LEVELS},
        SETTINGS | {"nominal": RECORDING},
        SETTINGS | {"trained": [1]},
    ],
)
def test_settings_that_are_no_model_are_refused(tmp_path, refused, settings):
    with refused("settings"):
        load(tmp_path, settings)


RUN_VALUES = np.zeros((30, 1), np.float32)


@pytest.mark.parametrize(
    "change",
    [
        {"interval_s": 0.0},
        {"columns": ["other"]},
        {"start": 5},
        {"parts": [RUN | {"offset_s": "0"}]},
        {"parts": [RUN | {"offset_s": float("nan")}]},
        {"parts": []},
        {"parts": [LEVELS]},
    ],
    ids=str,
)
def test_nominal_telemetry_that_does_not_fit_is_refused(tmp_path, refused, change):
    parts = [RUN | {"values": {"array": "values"}}]
    arrays = {"values": RUN_VALUES}
    assert load(tmp_path / "good", SETTINGS | {"nominal": RECORDING | {"parts": parts}}, **arrays).nominal.values.shape == (30, 1)
    changed = json.loads(json.dumps(RECORDING | {"parts": parts} | change).replace('"levels"', '"values"'))
    with refused("settings"):
        load(tmp_path / "bad", SETTINGS | {"nominal": changed}, **arrays)


@pytest.mark.parametrize("kind", ["EnhancedSimulator", "Telemetry", "FunctionSimulator", "Path", "eval", "builtins.open", ["Levels"], None])
def test_only_the_known_kinds_are_made(tmp_path, refused, kind):
    with refused("settings"):
        load(tmp_path, SETTINGS | {"quantisation": [{"kind": kind, "path": "/etc/passwd"}]})
