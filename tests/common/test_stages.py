"""Tests that stages run once, are reused, run again when a dependency changes, and are never left incomplete."""

import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import enhsim_tf
from enhsim_tf.common import stages
from enhsim_tf.common.atomic_files import replace_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages, default_cache, load_arrays, save_arrays

PACKAGE = Path(enhsim_tf.__file__).parent


class Work:
    """A stage that counts how often it is done, and all that it depends on."""

    def __init__(self, cache):
        self.cache, self.made = cache, []

    def run(self, settings=("a", 1), version=1, fresh=False, name="work", before=None):
        done = Stages(self.cache, fresh, tell=lambda line: None)
        after = ()
        if before is not None:
            done.run("before", self.make, before)
            after = ("before",)
        folder = done.run(name, self.make, settings, after, version)
        return folder, done.cached[name]

    def make(self, folder):
        self.made.append(folder)
        (folder / "result.txt").write_text(str(len(self.made)))


@pytest.fixture
def work(tmp_path):
    return Work(tmp_path / "cache")


def test_a_stage_is_done_once_and_found_again(work):
    first, cached = work.run()
    assert not cached and first.parent == work.cache and (first / "result.txt").read_text() == "1"
    again, cached = work.run()  # a second object, as in a second run
    assert cached and again == first and len(work.made) == 1


def test_what_it_depends_on_is_a_value_not_an_object(work):
    from enhsim_tf.paper.settings import make_settings

    first, _ = work.run(settings=make_settings("smoke", seed=1))
    assert work.run(settings=make_settings("smoke", seed=1)) == (first, True)
    assert work.run(settings=make_settings("smoke", seed=2)) != (first, True)


@pytest.mark.parametrize("changed", ["settings", "name", "version", "upstream"])
def test_a_changed_dependence_does_it_anew(work, changed):
    first, _ = work.run(before="one")
    turned = {"settings": {"settings": ("a", 2)}, "name": {"name": "other"}, "version": {"version": 2}, "upstream": {}}[changed]
    folder, cached = work.run(before="two" if changed == "upstream" else "one", **turned)
    assert not cached and folder != first
    assert first.is_dir(), "the earlier result is still in the cache"
    assert work.run(before="one") == (first, True)


def test_other_versions_do_it_anew(work, monkeypatch):
    first, _ = work.run()
    monkeypatch.setattr(stages, "VERSIONS", stages.VERSIONS | {"numpy": "0.0"})
    folder, cached = work.run()
    assert not cached and folder != first
    assert set(stages.VERSIONS) >= {"tensorflow", "keras", "numpy", "pandas", "scikit-learn"}


def test_fresh_does_it_anew_in_place_of_the_old(work):
    first, _ = work.run()
    folder, cached = work.run(fresh=True)
    assert (folder, cached) == (first, False) and (folder / "result.txt").read_text() == "2"
    assert work.run() == (first, True)
    assert [path.name for path in work.cache.iterdir()] == [first.name]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_stage_that_fails_leaves_nothing(tmp_path, error):
    def fails(folder):
        (folder / "half.txt").write_text("half")
        raise error

    for _ in range(2):
        with pytest.raises(error):
            Stages(tmp_path / "cache", tell=lambda line: None).run("work", fails, ())
        assert not list((tmp_path / "cache").iterdir())


def test_what_a_killed_run_left_is_not_taken_for_a_stage(work):
    folder, _ = work.run()
    half = folder.with_name(f".{folder.name}.0123abcd.tmp")
    folder.rename(half)  # as it lies there when the process is killed just before the last step
    assert work.run() == (folder, False) and len(work.made) == 2
    (folder / "stage.json").unlink()  # a folder of that name that is not a whole stage
    assert work.run() == (folder, False) and len(work.made) == 3


DAMAGES = {
    "a changed array": (lambda folder: flip(folder / "below" / "arrays.npz"), "below/arrays.npz is not as it was written"),
    "a file cut short": (lambda folder: os.truncate(folder / "result.txt", 0), "result.txt is not as it was written"),
    "a missing file": (lambda folder: (folder / "result.txt").unlink(), "result.txt is missing"),
    "a file of something else": (lambda folder: (folder / "arrays.npz").touch(), "arrays.npz is not of it"),
    "no stage.json": (lambda folder: (folder / "stage.json").unlink(), "stage.json is missing"),
    "a changed time": (lambda folder: retime(folder / "stage.json"), "stage.json is not as it was written"),
    "an older stage.json": (lambda folder: (folder / "stage.json").write_text('{"stage": "work", "seconds": 1}'), "stage.json is not"),
    "another stage's": (lambda folder: (folder / "stage.json").write_text("[]"), "stage.json is not as it was written"),
    "a file in its place": (lambda folder: (shutil.rmtree(folder), folder.write_text("x")), "stage.json is not as it was written"),
}


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def retime(path):
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"seconds": content["seconds"] + 1}))


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_stage_is_told_and_done_again(tmp_path, damage):
    def make(folder):
        (folder / "result.txt").write_text("whole")
        (folder / "below").mkdir()
        save_arrays(folder / "below", {"x": np.arange(100)})

    told = []
    folder = Stages(tmp_path / "cache", tell=told.append).run("work", make, ())
    before = stages._checksums(folder)
    do, words = DAMAGES[damage]
    do(folder)
    for cached in (False, True):
        del told[:]
        done = Stages(tmp_path / "cache", tell=told.append)
        assert done.run("work", make, ()) == folder and stages._checksums(folder) == before
        assert done.cached == {"work": cached} and (words in told[0]) is (not cached) and len(told) == (1 if cached else 3)
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_of_two_runs_at_once_the_first_keeps_its_place(work):
    def make(folder):
        (folder / "result.txt").write_text("x")
        if not first:  # while this run is at it, another one ends
            first.append(None)
            other = Stages(work.cache, tell=lambda line: None).run("work", make, ())
            first.append((other, os.stat(other).st_ino))

    first = []
    folder = Stages(work.cache, tell=lambda line: None).run("work", make, ())
    assert first[1] == (folder, os.stat(folder).st_ino), "what another run may be reading was put away"
    assert [path.name for path in work.cache.iterdir()] == [folder.name]


def test_what_a_killed_run_left_is_cleared_away_by_the_next(work):
    folder, _ = work.run()
    with replace_folder(folder.with_name("killed")) as temporary:
        shutil.copytree(temporary, half := temporary.with_name(temporary.name.replace("killed", "work")))
    assert half.is_dir()
    Stages(work.cache, tell=lambda line: None)
    assert not half.exists() and folder.is_dir()


def test_times_and_lines_tell_what_was_done(work, monkeypatch):
    clock = iter([10.0, 12.5])
    monkeypatch.setattr(stages, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    told = []
    for _ in range(2):
        done = Stages(work.cache, tell=told.append)
        folder = done.run("work", work.make, ())
        assert done.seconds == {"work": 2.5}, "the time it took when it was done"
    assert [line.split() for line in told] == [["work", "..."], ["work", "2.5", "s"], ["work", "2.5", "s", "(from", "the", "cache)"]]
    written = json.loads((folder / "stage.json").read_text())
    assert (written["stage"], written["seconds"], list(written["sha256"])) == ("work", 2.5, ["result.txt"])


def test_arrays_come_back_as_they_went(tmp_path):
    arrays = {
        "series": np.linspace(0, 1, 7, dtype=np.float32).reshape(7, 1),
        "times": np.array(["2020-01-01T00:00:00.123"], "datetime64[ms]"),
        "names": np.array(["stuck", "gain_loss"]),
        "empty": np.zeros((0, 3)),
        "flag": np.array(True),
    }
    save_arrays(tmp_path, arrays | {"number": 0.1}, "those")
    found = load_arrays(tmp_path, "those")
    assert set(found) == {*arrays, "number"} and found["number"].shape == () and found["number"] == 0.1
    for key, array in arrays.items():
        assert found[key].dtype == array.dtype and np.array_equal(found[key], array)
    save_arrays(tmp_path, {"objects": np.array([{}], object)})
    with pytest.raises(ValueError, match="pickle"):
        load_arrays(tmp_path)


def test_where_the_cache_is(tmp_path, monkeypatch):
    monkeypatch.delenv("ENHSIM_TF_CACHE", raising=False)
    assert default_cache() == Path(stages.__file__).parents[2] / ".cache"
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path / "elsewhere"))
    assert default_cache() == tmp_path / "elsewhere"


def test_a_cache_that_cannot_be_written_is_a_users_mistake(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="writ"):
        Stages(tmp_path / "file" / "cache")
