"""Saved models and data sets whose files are changed together with their checksums, as an attacker would do."""

import functools
import hashlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.folder import MANIFEST
from enhsim_tf.datasets.plan import FORMAT
from enhsim_tf.datasets.shard import shard_file
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from tests.known_simulators import of_waves
from tests.small_data_set import PlainMaker, plan

PLAN = plan(20, 10)


@functools.cache
def saved_model() -> dict[str, bytes]:
    """The files of a small saved simulator."""
    rng = np.random.default_rng(0)
    sizes = ((24, 8), (8, 4), (4, 24))  # a linear map of low rank beside a network, so that every kind of array is there
    kernels = [rng.standard_normal(size).astype(np.float32) / 5 for size in (*sizes, (24, 3), (3, 24))]
    layers = tuple((kernel, np.zeros(kernel.shape[1], np.float32)) for kernel in kernels[:3])
    zeros = np.zeros(24, np.float32)
    enhancer = Enhancer("ridge and random features", 24, 1, 1, np.zeros(1, np.float32), zeros, tuple(kernels[3:]), layers)
    coarse = SquareWaveSimulator([SquareWave(20.0, low=-1.0, high=1.0)])
    simulator = of_waves(
        [coarse],
        24,
        interval_s=2.0,
        enhancer=enhancer,
        noise=WindowBootstrap(rng.standard_normal((5, 24, 1)).astype(np.float32)),
        levels=np.ones((3, 1, 2)),
        channels=("telemetry",),
        trained={"epochs": 1},
    )
    with tempfile.TemporaryDirectory() as folder:
        simulator.save(Path(folder) / "model")
        return {path.name: path.read_bytes() for path in (Path(folder) / "model").iterdir()}


def arrays_of_model() -> dict[str, np.ndarray]:
    """The arrays of the saved simulator."""
    with np.load(io.BytesIO(saved_model()["arrays.npz"])) as arrays:
        return dict(arrays)


def npz_of(arrays: dict[str, np.ndarray]) -> bytes:
    """The content of a `.npz` file."""
    sink = io.BytesIO()
    np.savez(sink, **arrays)
    return sink.getvalue()


def settings_for(channel: str) -> bytes:
    """The settings of the saved simulator, for a channel of another name."""
    return json.dumps(json.loads(saved_model()["settings.json"]) | {"channels": [channel]}).encode()


def write_model(folder: Path, **changed: bytes) -> Path:
    """Writes a saved simulator with some files changed, named with `_` instead of the dot, and correct checksums."""
    files = saved_model() | {name.replace("_", ".", 1): content for name, content in changed.items()}
    if "manifest_json" not in changed:
        checksums = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items()) if name != "manifest.json"}
        files["manifest.json"] = json.dumps({"format": json.loads(files["manifest.json"])["format"], "sha256": checksums}).encode()
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


@functools.cache
def data_set() -> dict[str, bytes]:
    """The files of a small finished data set."""
    with tempfile.TemporaryDirectory() as folder:
        shards = {shard_file(number): PlainMaker(PLAN, folder)(number)[1] for number in range(2)}
        files = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
    return files | {MANIFEST: json.dumps({"format": FORMAT, "settings": PLAN.settings(), "shards": shards}).encode()}


def write_data_set(folder: Path, **changed: bytes) -> Path:
    """Writes a finished data set with another content of `manifest` or of `shard`, which is the first."""
    names = {"manifest": MANIFEST, "shard": shard_file(0)}
    folder.mkdir(parents=True)
    for name, content in (data_set() | {names[name]: content for name, content in changed.items()}).items():
        (folder / name).write_bytes(content)
    return folder
