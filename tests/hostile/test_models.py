"""A malicious model cannot run code, allocate more memory than its files justify, or access files outside its folder.

Each payload would create a file if it ran. All checksums are correct, as an attacker would make them.
"""

import io
import json
import marshal
import os
import pickle
import zipfile

import keras
import numpy as np
import pytest

from enhsim_tf.datasets.plan import make_plan
from enhsim_tf.datasets.scenario_file import Mix
from enhsim_tf.enhanced_simulator.safe_loading import check_network, read_description
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.telemetry.sources import read_source, read_telemetry
from tests.fuzzing.of_folders import archive_of, member_of, saved_model, write_model


@pytest.fixture
def refused_without_running(tmp_path, refused):
    """Loads a model, and checks that it is refused in one line and that no payload ran."""

    def check(*words, **changed):
        model = write_model(tmp_path / "models" / "volts", **changed)
        before = sorted(path.name for path in tmp_path.rglob("*"))
        with refused(*words):
            EnhancedSimulator.load(model)
        assert not (tmp_path / "ran").exists() and sorted(path.name for path in tmp_path.rglob("*")) == before

    return check


def description():
    return json.loads(member_of("enhancer", "config.json"))


def enhancer_of(content) -> bytes:
    return archive_of("enhancer", config=json.dumps(content).encode())


def layer(kind, module="keras.layers", registered=None, **settings):
    return {
        "module": module,
        "class_name": kind,
        "config": {"name": "odd"} | settings,
        "registered_name": registered,
        "build_config": {"input_shape": [None, 24]},
    }


def with_layer(added) -> bytes:
    content = description()
    content["config"]["layers"].insert(1, added)
    return enhancer_of(content)


def test_the_model_as_it_was_written_loads(tmp_path):
    model = write_model(tmp_path / "model")
    assert EnhancedSimulator.load(model).generate(2).shape == (2, 24) and make_plan(Mix(), model, 0, 5).window == 24


@pytest.mark.filterwarnings("default")  # as for users: Keras would only warn and keep untrained weights
def test_a_network_whose_weights_are_those_of_another_is_refused(refused_without_running):
    content = json.loads(member_of("generator", "config.json"))
    content["config"]["name"] = "enhancer"
    refused_without_running("no matching group", enhancer_keras=enhancer_of(content))


def test_marshalled_code_in_a_lambda_layer_does_not_run(tmp_path, refused_without_running):
    import base64

    code = compile(f"open({str(tmp_path / 'ran')!r}, 'w')", "payload", "eval")
    exec(code)  # unprotected, it runs
    os.remove(tmp_path / "ran")
    function = {
        "class_name": "__lambda__",
        "config": {"code": base64.b64encode(marshal.dumps(code)).decode(), "defaults": None, "closure": None},
    }
    refused_without_running("Lambda", enhancer_keras=with_layer(layer("Lambda", function=function)))


def test_a_lambda_layer_that_keras_itself_saved_does_not_run(tmp_path, refused_without_running):
    network = keras.Sequential(
        [keras.Input((24,)), keras.layers.Lambda(lambda values, path=str(tmp_path / "ran"): (open(path, "w"), values)[1])]
    )
    network.save(tmp_path / "lambda.keras")
    (tmp_path / "ran").unlink()  # building it here ran the payload
    refused_without_running("Lambda", enhancer_keras=(tmp_path / "lambda.keras").read_bytes())


@pytest.mark.parametrize(
    ("module", "kind", "registered"),
    [
        ("os", "system", None),
        ("subprocess", "Popen", None),
        ("builtins", "eval", None),
        ("keras.utils", "get_file", None),
        ("keras.models", "load_model", None),
        ("keras.layers", "TFSMLayer", None),
        ("keras.layers", "TorchModuleWrapper", None),
        ("keras.layers", "StringLookup", None),
        ("keras.src.saving.saving_lib", "load_model", None),
        ("keras.layers", "Dense", "ours>Dense"),
        (None, "Dense", None),
        (None, "function", None),
    ],
)
def test_other_classes_and_functions_are_refused(refused_without_running, module, kind, registered):
    refused_without_running(enhancer_keras=with_layer(layer(kind, module, registered, filepath="../../ran", vocabulary="/etc/passwd")))


def test_a_registered_class_is_not_instantiated(tmp_path, refused_without_running):
    @keras.saving.register_keras_serializable("hostile")
    class Opens(keras.layers.Layer):
        def __init__(self, path, **options):
            super().__init__(**options)
            open(path, "w").close()

    Opens(str(tmp_path / "ran"))
    (tmp_path / "ran").unlink()
    odd = layer("Opens", "tests.hostile.test_models", "hostile>Opens", path=str(tmp_path / "ran"))
    refused_without_running("Opens", enhancer_keras=with_layer(odd))
    odd = layer("Dense", "keras.layers", "hostile>Opens", path=str(tmp_path / "ran"))
    refused_again = write_model(tmp_path / "again", enhancer_keras=with_layer(odd))
    with pytest.raises(ValueError, match="registered as"):
        check_network(refused_again / "enhancer.keras")


class Payload:
    """Creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_pickled_objects_in_arrays_are_not_loaded(tmp_path, refused):
    ran = str(tmp_path / "ran")
    content = pickle.dumps(Payload(ran))
    pickle.loads(content).close()  # unprotected, it runs
    os.remove(ran)
    (tmp_path / "plain.npy").write_bytes(content)
    np.save(tmp_path / "objects.npy", np.array([Payload(ran)] * 3, object), allow_pickle=True)
    np.savez(tmp_path / "objects.npz", mean=np.array([Payload(ran)], object), explained=0.9, weight=0.1, allow_pickle=True)
    os.path.exists(ran) and os.remove(ran)
    for name in ("plain.npy", "objects.npy"):
        for read in (read_source, read_telemetry):
            with refused(name):
                read(tmp_path / name)
    with refused("objects.npz"):
        OutOfRange.load(tmp_path / "objects.npz")
    assert not os.path.exists(ran)


@pytest.mark.parametrize("name", ["../../ran", "/tmp/ran", "assets/ran", "model.weights.npz", "config.json"])
def test_other_members_of_an_archive_are_refused(refused_without_running, name):
    sink = io.BytesIO(saved_model()["enhancer.keras"])
    with zipfile.ZipFile(sink, "a") as archive:
        if name == "config.json":
            with pytest.warns(UserWarning, match="Duplicate"):
                archive.writestr(name, "{}")
        else:
            archive.writestr(name, "payload")
    refused_without_running("archive of other files", enhancer_keras=sink.getvalue())


def test_a_compressed_archive_is_refused(refused_without_running):
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("config.json", member_of("enhancer", "config.json"))
        archive.writestr("metadata.json", "{}")
        archive.writestr("model.weights.h5", bytes(300_000_000))
    assert len(sink.getvalue()) < 400_000
    refused_without_running("compressed", enhancer_keras=sink.getvalue())


def dense(**changed):
    content = description()
    found = next(each for each in content["config"]["layers"] if each["class_name"] == "Dense")
    found["config"] |= {name: value for name, value in changed.items() if name != "shape"}
    if "shape" in changed:
        found["build_config"]["input_shape"] = changed["shape"]
    return enhancer_of(content)


@pytest.mark.parametrize(
    "changed",
    [
        {"units": 10**9},
        {"units": 10**9, "shape": [None, 10**9]},
        {"shape": [None, 10**9]},
        {"shape": []},
        {"shape": None},
        {"units": -1},
        {"units": 1e9},
        {"units": True},
        {"lora_rank": 10**9},
        {"quantization_config": {"module": "keras.quantizers", "class_name": "Int8QuantizationConfig", "config": {}}},
    ],
)
def test_layers_of_more_weights_than_the_file_holds_are_refused(refused_without_running, changed):
    refused_without_running(enhancer_keras=dense(**changed))


def test_normalisation_with_a_huge_shape_is_refused(refused_without_running):
    odd = layer("Normalization", mean=[0.0], variance=[1.0], axis=-1) | {"build_config": {"input_shape": [None, 10**9]}}
    refused_without_running("weights in a file", enhancer_keras=with_layer(odd))


def weights_of(make) -> bytes:
    import h5py

    sink = io.BytesIO(member_of("enhancer", "model.weights.h5"))
    with h5py.File(sink, "a") as file:
        make(file, next(path for path in _datasets(file) if path.endswith("vars/0")))
    return archive_of("enhancer", weights=sink.getvalue())


def _datasets(file):
    found = []
    file.visititems(lambda name, part: found.append(name) if hasattr(part, "dtype") else None)
    return found


def _declare(file, path):
    del file[path]
    file.create_dataset(path, shape=(10**6, 10**6), dtype="f4", chunks=(1000, 1000))


def _lead_out(file, path):
    del file[path]
    file.create_dataset(path, shape=(24, 24), dtype="f4", external=[("/etc/passwd", 0, 24 * 24 * 4)])


@pytest.mark.parametrize("make", [_declare, _lead_out])
def test_weights_that_are_not_in_the_file_are_refused(refused_without_running, make):
    refused_without_running("in full", enhancer_keras=weights_of(make))


def test_the_other_networks_are_checked_too(refused_without_running):
    content = json.loads(member_of("generator", "config.json"))
    content["config"]["layers"].append(layer("Lambda"))
    refused_without_running("Lambda", generator_keras=archive_of("generator", config=json.dumps(content).encode()))


def test_a_description_of_many_layers_or_many_levels_is_refused(tmp_path):
    content = description()
    content["config"]["layers"] *= 1_000
    for text, word in ((json.dumps(content), "layers"), ('{"a": ' * 100_000 + "1" + "}" * 100_000, "recursion")):
        (tmp_path / "x.keras").write_bytes(archive_of("enhancer", config=text.encode()))
        with pytest.raises(ValueError, match=word):
            read_description(tmp_path / "x.keras")
