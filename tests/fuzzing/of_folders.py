"""Targets that read folders written by the package: saved models and large data sets.

Content protected by a checksum is changed together with its checksum, as an attacker would do.
"""

import functools
import hashlib
import io
import json
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from enhsim_tf.datasets.folder import JOURNAL, MANIFEST, check_folder, read_manifest, read_records
from enhsim_tf.datasets.generate import verify
from enhsim_tf.datasets.plan import FORMAT, Model, Plan, make_plan
from enhsim_tf.datasets.scenario_file import Mix, ScenarioShare
from enhsim_tf.datasets.shard import shard_file
from enhsim_tf.enhanced_simulator.model_folder import models_of, refuse_foreign
from tests.fuzzing.target import Target, all_of, json_of

_NETWORKS = ("enhancer", "generator", "discriminator")
_WINDOW = 24
_MIX = Mix(0.5, (ScenarioShare("stuck", 0.5, (0.2, 0.9), (0.0, 0.5)),))
_PLAN = Plan(_MIX, (Model("model", Path("nowhere"), 1.0, "0" * 64, 60, 2.0),), 3, 20, 10)


@functools.cache
def saved_model() -> dict[str, bytes]:
    """The files of a small saved simulator."""
    from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.enhancer.network import build_enhancer
    from enhsim_tf.noise.convolutional_gan import build_convolutional_generator
    from enhsim_tf.noise.discriminator import build_discriminator
    from enhsim_tf.noise.gan import NoiseGAN

    noise = NoiseGAN(build_convolutional_generator(2, 3, 2, 1, 2), build_discriminator(_WINDOW, 2, 4), slow_samples=(50.0,))
    coarse = SquareWaveSimulator([SquareWave(20.0, low=-1.0, high=1.0)])
    simulator = EnhancedSimulator(coarse, build_enhancer(_WINDOW, 4, 1), noise, 2.0, levels=np.ones((3, 2)), trained={"epochs": 1})
    with tempfile.TemporaryDirectory() as folder:
        simulator.save(Path(folder) / "model")
        return {path.name: path.read_bytes() for path in (Path(folder) / "model").iterdir()}


def write_model(folder: Path, **changed: bytes) -> Path:
    """Writes a saved simulator with some files changed and correct checksums.

    Args:
        folder: Where to.
        **changed: Content by file name, with `_` instead of the dot.
    """
    files = saved_model() | {name.replace("_", ".", 1): content for name, content in changed.items()}
    if "manifest_json" not in changed:
        checksums = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items()) if name != "manifest.json"}
        files["manifest.json"] = json.dumps({"format": json.loads(files["manifest.json"])["format"], "sha256": checksums}).encode()
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


def archive_of(name: str, **members: bytes) -> bytes:
    """The archive of a saved network with some members changed.

    Args:
        name: Of the network.
        **members: `config`, `weights`.
    """
    names = {"config.json": "config", "model.weights.h5": "weights", "metadata.json": "metadata"}
    sink = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(saved_model()[f"{name}.keras"])) as before, zipfile.ZipFile(sink, "w") as after:
        for member in before.namelist():
            after.writestr(member, members.get(names[member], before.read(member)))
    return sink.getvalue()


def member_of(name: str, member: str) -> bytes:
    """Reads a member of the archive of a saved network."""
    with zipfile.ZipFile(io.BytesIO(saved_model()[f"{name}.keras"])) as archive:
        return archive.read(member)


def _plan(folder: Path) -> None:
    make_plan(_MIX, folder, 0, 100)


def _load(folder: Path) -> None:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

    EnhancedSimulator.load(folder)


def _manifest(data: bytes, folder: Path) -> None:
    model = write_model(folder / "models" / "volts", manifest_json=data)
    all_of(lambda: models_of(folder / "models"), lambda: refuse_foreign(model), lambda: _plan(model), lambda: _load(model))


def _settings(data: bytes, folder: Path) -> None:
    model = write_model(folder / "model", settings_json=data)
    all_of(lambda: _plan(model), lambda: _load(model))


def _description(data: bytes, folder: Path) -> None:
    """JSON as the configuration of one of the networks, which is chosen by its name."""
    try:
        name = json.loads(data)["config"]["name"]
    except (ValueError, KeyError, TypeError, RecursionError):
        name = "enhancer"
    name = name if name in _NETWORKS else "enhancer"
    model = write_model(folder / "model", **{f"{name}_keras": archive_of(name, config=data)})
    all_of(lambda: _plan(model), lambda: _load(model))


def _archive(data: bytes, folder: Path) -> None:
    model = write_model(folder / "model", enhancer_keras=data)
    all_of(lambda: _plan(model), lambda: _load(model))


def _weights(data: bytes, folder: Path) -> None:
    _load(write_model(folder / "model", enhancer_keras=archive_of("enhancer", weights=data)))


def _planned(data: bytes, folder: Path) -> None:
    """JSON as the settings and description of a model, which are read for planning without loading it."""
    content = json_of(data)
    texts = {name: json.dumps(content.get(name)).encode() for name in ("settings", "config")}
    model = write_model(folder / "model", settings_json=texts["settings"], enhancer_keras=archive_of("enhancer", config=texts["config"]))
    _plan(model)


def _planned_seeds() -> list[bytes]:
    config = json.loads(member_of("enhancer", "config.json"))
    return [json.dumps({"settings": json.loads(saved_model()["settings.json"]), "config": config}).encode()]


@functools.cache
def data_set() -> dict[str, bytes]:
    """The files of a small finished data set."""
    from tests.faults import small_data_set

    with tempfile.TemporaryDirectory() as folder:
        before = os.environ.copy()
        maker = small_data_set.PlainMaker(_PLAN, folder)
        records = [maker(number) for number in range(2)]
        shards = [{"file": shard_file(each.shard), "rows": each.rows, "sha256": each.sha256} for each in records]
        files = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
        os.environ.update(before)
    manifest = {"format": FORMAT, "settings": _PLAN.settings(), "shards": shards}
    return files | {MANIFEST: json.dumps(manifest).encode()}


def write_data_set(folder: Path, **changed: bytes) -> Path:
    """Writes a finished data set with some files changed.

    Args:
        folder: Where to.
        **changed: Contents of `manifest`, `journal` and `shard`, which is the first.
    """
    names = {"manifest": MANIFEST, "journal": JOURNAL, "shard": shard_file(0)}
    files = data_set() | {names[name]: content for name, content in changed.items()}
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


def _look_at(folder: Path) -> None:
    lines: list[str] = []
    all_of(
        lambda: read_manifest(folder),
        lambda: read_records(folder),
        lambda: check_folder(folder, _PLAN),
        lambda: verify(folder, lines.append),
    )
    assert all(line.isprintable() for line in lines)


def _data_set_manifest(data: bytes, folder: Path) -> None:
    _look_at(write_data_set(folder / "set", manifest=data))


def _journal(data: bytes, folder: Path) -> None:
    unfinished = json.loads(data_set()[MANIFEST]) | {"shards": None}
    _look_at(write_data_set(folder / "set", manifest=json.dumps(unfinished).encode(), journal=data))


def _journal_seeds() -> list[bytes]:
    shards = json.loads(data_set()[MANIFEST])["shards"]
    lines = [json.dumps([number, each["rows"], each["sha256"]]) for number, each in enumerate(shards)]
    return ["\n".join(lines).encode(), f"{lines[0]}\n{lines[1][:20]}".encode()]


def _shard(data: bytes, folder: Path) -> None:
    manifest = json.loads(data_set()[MANIFEST])
    manifest["shards"][0]["sha256"] = hashlib.sha256(data).hexdigest()
    _look_at(write_data_set(folder / "set", manifest=json.dumps(manifest).encode(), shard=data))
    (folder / "set" / MANIFEST).unlink()
    check_folder(folder / "set", _PLAN)


def _shard_seeds() -> list[bytes]:
    return [data_set()[shard_file(0)]]


TARGETS = {
    "manifest of a model": Target(_manifest, lambda: [saved_model()["manifest.json"]], "json", 0.3),
    "settings of a model": Target(_settings, lambda: [saved_model()["settings.json"]], "json", 0.2),
    "description of a network": Target(_description, lambda: [member_of(name, "config.json") for name in _NETWORKS], "json", 0.2),
    "archive of a network": Target(_archive, lambda: [saved_model()["enhancer.keras"]], "bytes", 0.2),
    "weights of a network": Target(_weights, lambda: [member_of("enhancer", "model.weights.h5")], "bytes", 0.1),
    "model that is planned with": Target(_planned, _planned_seeds, "json", 4),
    "manifest of a data set": Target(_data_set_manifest, lambda: [data_set()[MANIFEST]], "json", 4),
    "journal of a data set": Target(_journal, _journal_seeds, "text", 4),
    "shard of a data set": Target(_shard, _shard_seeds, "bytes", 3),
}
