"""Folders of models and data sets with any content are read, or refused in one line. Checksums are changed with what they protect."""

import hashlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enhsim_tf.datasets.folder import MANIFEST, check_folder, find_problems, read_manifest
from enhsim_tf.datasets.plan import make_plan
from enhsim_tf.datasets.shard import finished_shards, shard_file
from enhsim_tf.simulator.model_folder import models_of, refuse_foreign
from enhsim_tf.simulator.simulator import EnhancedSimulator
from tests.fuzzing.readers import all_of, changed, changed_json, judge, tried
from tests.hostile.folders import PLAN, data_set, saved_model, write_data_set, write_model


def read_model(file, data, folder):
    model = write_model(folder / "models" / "volts", **{file: data})
    all_of(
        lambda: models_of(folder / "models"),
        lambda: refuse_foreign(model),
        lambda: make_plan(EnhancedSimulator.load(model), model, (), 1.0, 100, 0),
    )


def load_model(data, folder):
    EnhancedSimulator.load(write_model(folder / "model", arrays_npz=data))


def test_folders_as_they_were_written_are_accepted():
    assert judge(load_model, saved_model()["arrays.npz"]) and judge(read_data_set, {})


@pytest.mark.parametrize("file", ["manifest.json", "settings.json"])
@tried(60)
@given(st.data())
def test_manifests_and_settings_of_models(file, data):
    seeds = [saved_model()[file]]
    judge(read_model, file.replace(".", "_"), data.draw(changed_json(seeds) | changed(seeds)))


@tried(60)
@given(changed([saved_model()["arrays.npz"]]))
def test_arrays_of_models(data):
    judge(load_model, data)


def read_data_set(files, folder):
    made = write_data_set(folder / "set", **files)
    lines = []
    all_of(lambda: read_manifest(made), lambda: check_folder(made, PLAN), lambda: lines.extend(find_problems(made)))
    assert len(list(finished_shards(made, PLAN))) in (1, 2)
    assert all(line.isprintable() for line in lines)


@tried(60)
@given(changed_json([data_set()[MANIFEST]]) | changed([data_set()[MANIFEST]]))
def test_manifests_of_data_sets(data):
    judge(read_data_set, {"manifest": data})


@tried(60)
@given(changed([data_set()[shard_file(0)]]))
def test_shards_of_data_sets(data):
    manifest = json.loads(data_set()[MANIFEST])
    manifest["shards"][shard_file(0)] = hashlib.sha256(data).hexdigest()
    judge(read_data_set, {"manifest": json.dumps(manifest).encode(), "shard": data})
