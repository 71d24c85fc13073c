"""Stages run once, are reused, run again when a dependency changes or the result is damaged, and
are never left incomplete.
"""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.common import console, stages
from enhsim_tf.common.atomic_files import replace_folder
from enhsim_tf.common.console import SILENT
from enhsim_tf.common.stages import Stages, default_cache, load_arrays, save_arrays
from enhsim_tf.paper.settings import make_settings
from tests.datasets.test_generate import flip


class Work:
    """A stage that counts how often it is done, and all that it depends on."""

    def __init__(self, cache):
        self.cache, self.made, self.told = cache, 0, []

    def run(self, settings=("a", 1), version=1, fresh=False, name="work", before=None):
        done = Stages(self.cache, fresh, tell=self.told.append)
        if before is not None:
            done.run("before", self.make, before)
        folder = done.run(name, self.make, settings, () if before is None else ("before",), version)
        return folder, done.cached[name]

    def make(self, folder):
        self.made += 1
        (folder / "result.txt").write_text(str(self.made))
        (folder / "below").mkdir()
        save_arrays(folder / "below", {"x": np.arange(100)})


@pytest.fixture
def work(tmp_path):
    return Work(tmp_path / "cache")


def test_a_stage_is_done_once_and_found_again_by_the_values_of_its_settings(work):
    first, cached = work.run(settings=make_settings("smoke", seed=1))
    assert not cached and first.parent == work.cache and (first / "result.txt").read_text() == "1"
    # other objects, as in a second run
    assert work.run(settings=make_settings("smoke", seed=1)) == (first, True) and work.made == 1
    assert work.told[-1].startswith("work") and work.told[-1].endswith("(from the cache)")


def test_the_key_of_known_settings_stays(work, monkeypatch):
    monkeypatch.setattr(stages, "VERSIONS", {"keras": "1"})
    assert work.run()[0].name == "work-6979b3ccab4bfff6", (
        "another key would do all stages of former runs again"
    )


@pytest.mark.parametrize(
    "changed", [{"settings": ("a", 2)}, {"name": "other"}, {"version": 2}, {"before": "two"}, {}]
)
def test_a_changed_dependence_does_it_anew(work, changed, monkeypatch):
    first, _ = work.run(before="one")
    if not changed:
        monkeypatch.setattr(stages, "VERSIONS", stages.VERSIONS | {"numpy": "0.0"})
    folder, cached = work.run(**{"before": "one"} | changed)
    assert not cached and folder != first
    monkeypatch.undo()
    assert work.run(before="one") == (first, True), "the earlier result is still in the cache"


def test_fresh_does_it_anew_in_place_of_the_old(work):
    first, _ = work.run()
    assert work.run(fresh=True) == (first, False) and (first / "result.txt").read_text() == "2"
    assert work.run() == (first, True)
    assert [path.name for path in work.cache.iterdir()] == [first.name]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_stage_that_fails_leaves_nothing(tmp_path, error):
    done = Stages(tmp_path / "cache", tell=lambda line: None, speaks=True)

    def fails(folder):
        (folder / "half.txt").write_text("half")
        assert done.progress is not SILENT
        raise error

    with pytest.raises(error):
        done.run("work", fails, ())
    assert not list((tmp_path / "cache").iterdir()) and done.progress is SILENT


def test_a_stage_reports_progress_under_its_name_if_asked_to(tmp_path, monkeypatch):
    monkeypatch.setattr(console, "INTERVAL_S", 0.0)
    told = []
    done = Stages(tmp_path, tell=told.append, speaks=True)
    done.run("enhancer", lambda folder: done.progress.loop("epoch", 4)(1), ())
    assert told[1].startswith("enhancer     epoch 1 of 4, 25 %")


DAMAGES = {
    "a changed array": lambda folder: flip(folder / "below" / "arrays.npz"),
    "a missing file": lambda folder: (folder / "result.txt").unlink(),
    "a file of something else": lambda folder: (folder / "arrays.npz").touch(),
    "no stage.json": lambda folder: (folder / "stage.json").unlink(),
    "an older stage.json": lambda folder: (folder / "stage.json").write_text(
        '{"stage": "work", "seconds": 1}'
    ),
    "a file in its place": lambda folder: (shutil.rmtree(folder), folder.write_text("x")),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_stage_is_told_and_done_again(work, damage):
    folder, _ = work.run()
    DAMAGES[damage](folder)
    assert work.run() == (folder, False) and work.run() == (folder, True) and work.made == 2
    assert sum("damaged in the cache" in line for line in work.told) == 1
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_of_two_runs_at_once_the_first_keeps_its_place(work):
    def make(folder):
        work.make(folder)
        if not first:  # while this run is at it, another one ends
            first.append(None)
            other = Stages(work.cache, tell=lambda line: None).run("work", make, ())
            first.append((other, os.stat(other).st_ino))

    first = []
    folder = Stages(work.cache, tell=lambda line: None).run("work", make, ())
    assert first[1] == (folder, os.stat(folder).st_ino), (
        "what another run may be reading was put away"
    )
    assert [path.name for path in work.cache.iterdir()] == [folder.name]


def test_what_a_killed_run_left_is_cleared_away_by_the_next(work):
    folder, _ = work.run()
    with replace_folder(folder.with_name("killed")) as temporary:
        shutil.copytree(
            temporary, half := temporary.with_name(temporary.name.replace("killed", "work"))
        )
    assert half.is_dir()
    assert work.run() == (folder, True) and not half.exists()


def test_arrays_come_back_as_they_went(tmp_path):
    arrays = {
        "times": np.array(["2020-01-01T00:00:00.123"], "datetime64[ms]"),
        "names": np.array(["stuck"]),
        "empty": np.zeros((0, 3)),
    }
    save_arrays(tmp_path, arrays | {"number": 0.1}, "those")
    found = load_arrays(tmp_path, "those")
    assert set(found) == {*arrays, "number"}
    assert found["number"].shape == () and found["number"] == 0.1
    for key, array in arrays.items():
        assert found[key].dtype == array.dtype and np.array_equal(found[key], array)


def test_where_the_cache_is(tmp_path, monkeypatch, refused):
    monkeypatch.delenv("ENHSIM_TF_CACHE", raising=False)
    assert default_cache() == Path(stages.__file__).parents[2] / ".cache"
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path / "elsewhere"))
    assert default_cache() == tmp_path / "elsewhere"
    (tmp_path / "file").touch()
    with refused("writ"):
        Stages(tmp_path / "file" / "cache")
