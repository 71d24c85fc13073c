import numpy as np
import pytest

from enhsim_tf.common.stages import Stages, load_arrays, save_arrays


@pytest.fixture
def made():
    """The stages that were made, and a function that makes one."""
    names = []

    def make(folder):
        names.append(folder)
        save_arrays(folder, {"series": np.arange(3), "number": 1.5})

    return names, make


def quiet(cache, **options):
    return Stages(cache, tell=lambda line: None, **options)


def test_a_finished_stage_is_found_by_the_next_run_with_the_same_content(tmp_path, made):
    names, make = made
    folders = [quiet(tmp_path).run("one", make, {"seed": 1}) for _ in range(2)]
    assert folders[0] == folders[1] and len(names) == 1
    found = load_arrays(folders[0])
    assert found["series"].tolist() == [0, 1, 2] and float(found["number"]) == 1.5


@pytest.mark.parametrize("change", [{"settings": {"seed": 2}}, {"version": 2}, {"name": "two"}, {"after": ["before"]}])
def test_other_settings_version_or_stages_before_make_it_again(tmp_path, made, change):
    names, make = made
    for changed in ({}, change):
        stages = quiet(tmp_path)
        stages.run("before", lambda folder: None, {})
        stages.run(**{"name": "one", "make": make, "settings": {"seed": 1}} | changed)
    assert len(names) == 2


def test_a_change_before_changes_what_comes_after(tmp_path, made):
    names, make = made
    for version in (1, 2):
        stages = quiet(tmp_path)
        stages.run("before", lambda folder: None, {}, version)
        stages.run("after", make, {}, after=["before"])
    assert len(names) == 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda folder: (folder / "arrays.npz").write_bytes(b"other"),
        lambda folder: (folder / "arrays.npz").unlink(),
        lambda folder: (folder / "more").write_text("x"),
        lambda folder: (folder / "stage.json").write_text("{"),
        lambda folder: (folder / "stage.json").write_text("[1]"),
        lambda folder: (folder / "stage.json").unlink(),
    ],
)
def test_a_damaged_stage_is_made_again(tmp_path, made, damage):
    names, make = made
    lines = []
    damage(quiet(tmp_path).run("one", make, {}))
    folder = Stages(tmp_path, tell=lines.append).run("one", make, {})
    assert len(names) == 2 and load_arrays(folder)["series"].tolist() == [0, 1, 2]
    assert any("damaged" in line for line in lines)


def test_an_interrupted_stage_leaves_nothing_behind(tmp_path, made):
    def interrupted(folder):
        save_arrays(folder, {"half": 1})
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        quiet(tmp_path).run("one", interrupted, {})
    assert list(tmp_path.iterdir()) == []
    names, make = made
    quiet(tmp_path).run("one", make, {})
    assert len(names) == 1


def test_fresh_makes_every_stage_again(tmp_path, made):
    names, make = made
    quiet(tmp_path).run("one", make, {})
    stages = quiet(tmp_path, fresh=True)
    stages.run("one", make, {})
    assert len(names) == 2 and stages.cached == {"one": False}
