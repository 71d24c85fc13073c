"""Tests that stages run once, are reused, run again when a dependency changes, and are never left incomplete."""

import ast
import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import enhsim_tf
from enhsim_tf.common.atomic_files import replace_folder
from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce import stages
from enhsim_tf.reproduce.paper import pipeline
from enhsim_tf.reproduce.stages import Stages, default_cache, imports_of, load_arrays, save_arrays

PACKAGE = Path(enhsim_tf.__file__).parent


@pytest.fixture
def toy_package(tmp_path, monkeypatch):
    """A package of three modules: `upper` works with `lower`, `apart` stands by itself."""
    package = tmp_path / "enhsim_tf"
    (package / "reproduce").mkdir(parents=True)
    (package / "reproduce" / "upper.py").write_text("from enhsim_tf.lower import x\n")
    (package / "lower.py").write_text("x = 1\n")
    (package / "apart.py").write_text("y = 1\n")
    monkeypatch.setattr(stages, "_PACKAGE", package)
    return package


class Work:
    """A stage that counts how often it is done, and all that it depends on."""

    def __init__(self, cache):
        self.cache, self.made = cache, []

    def run(self, settings=("a", 1), modules=("reproduce.upper",), fresh=False, name="work", before=None):
        done = Stages(self.cache, fresh, tell=lambda line: None)
        after = ()
        if before is not None:
            done.run("before", self.make, (), before)
            after = ("before",)
        folder = done.run(name, self.make, modules, settings, after)
        return folder, done.cached[name]

    def make(self, folder):
        self.made.append(folder)
        (folder / "result.txt").write_text(str(len(self.made)))


@pytest.fixture
def work(tmp_path, toy_package):
    return Work(tmp_path / "cache")


def test_a_stage_is_done_once_and_found_again(work):
    first, cached = work.run()
    assert not cached and first.parent == work.cache and (first / "result.txt").read_text() == "1"
    again, cached = work.run()  # a second object, as in a second run
    assert cached and again == first and len(work.made) == 1


def test_what_it_depends_on_is_a_value_not_an_object(work):
    from enhsim_tf.reproduce.settings import make_settings

    first, _ = work.run(settings=make_settings("smoke", 1))
    assert work.run(settings=make_settings("smoke", 1)) == (first, True)
    assert work.run(settings=make_settings("smoke", 2)) != (first, True)


@pytest.mark.parametrize("changed", ["settings", "name", "modules", "upstream"])
def test_a_changed_dependence_does_it_anew(work, changed):
    first, _ = work.run(before="one")
    turned = {"settings": {"settings": ("a", 2)}, "name": {"name": "other"}, "modules": {"modules": ("apart",)}, "upstream": {}}[changed]
    folder, cached = work.run(before="two" if changed == "upstream" else "one", **turned)
    assert not cached and folder != first
    assert first.is_dir(), "the earlier result is still in the cache"
    assert work.run(before="one") == (first, True)


def test_changed_code_of_a_module_or_of_one_below_does_it_anew(work, toy_package):
    first, _ = work.run()
    (toy_package / "apart.py").write_text("y = 2\n")
    assert work.run() == (first, True), "a module that it does not import"
    (toy_package / "lower.py").write_text("x = 2\n")
    second, cached = work.run()
    assert not cached and second != first, "an imported module"
    (toy_package / "reproduce" / "upper.py").write_text("from enhsim_tf.lower import x\n\nx += 1\n")
    third, cached = work.run()
    assert not cached and third not in (first, second), "its own module"


def test_what_is_said_about_code_changes_no_stage(work, toy_package):
    first, _ = work.run()
    (toy_package / "reproduce" / "upper.py").write_text('"""What it is."""\n\nfrom enhsim_tf.lower import x  # why\n')
    (toy_package / "lower.py").write_text("# an explanation\nx = (\n    1  # one\n)\n")
    assert work.run() == (first, True)


@pytest.mark.parametrize(
    ("before", "after", "is_same"),
    [
        ("def f():\n    return 1\n", 'def f():\n    """One."""\n\n    return 1  # one\n', True),
        ("class A:\n    x = 1\n", 'class A:\n    """A."""\n\n    x = 1\n', True),
        ('def f():\n    """Only words."""\n', 'def f():\n    """Other words."""\n', True),
        ("    def f(self):\n        return 1\n", "    def f(self):\n\n        return 1\n", True),
        ("def f():\n    return 1\n", "def f():\n    return 2\n", False),
        ("def f():\n    return 'a'\n", "def f():\n    return 'b'\n", False),
        ("x = [1]\n'word'\n", "x = [1]\n'other'\n", False),
    ],
)
def test_the_hash_of_code_leaves_comments_and_docstrings_out(before, after, is_same):
    assert (stages.what_runs(before) == stages.what_runs(after)) == is_same


def test_changed_code_of_the_stage_itself_does_it_anew(tmp_path, toy_package):
    def one(folder):
        save_arrays(folder, {"x": 1})

    def two(folder):
        save_arrays(folder, {"x": 2})

    values = [load_arrays(Stages(tmp_path / "cache", tell=lambda line: None).run("work", make, (), ()))["x"] for make in (one, two, one)]
    assert values == [1, 2, 1]


def test_changed_code_of_a_helper_does_it_anew(tmp_path, toy_package):
    def one():
        return 1

    def two():
        return 2

    def make(folder):
        save_arrays(folder, {"x": 0})

    def key(*helpers):
        return Stages(tmp_path / "cache", tell=lambda line: None).run("work", make, (), (), helpers=helpers).name

    assert key(one) == key(one) and len({key(), key(one), key(two), key(one, two)}) == 4


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
def test_a_stage_that_fails_leaves_nothing(tmp_path, toy_package, error):
    def fails(folder):
        (folder / "half.txt").write_text("half")
        raise error

    for _ in range(2):
        with pytest.raises(error):
            Stages(tmp_path / "cache", tell=lambda line: None).run("work", fails, (), ())
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
def test_a_damaged_stage_is_told_and_done_again(tmp_path, toy_package, damage):
    def make(folder):
        (folder / "result.txt").write_text("whole")
        (folder / "below").mkdir()
        save_arrays(folder / "below", {"x": np.arange(100)})

    told = []
    folder = Stages(tmp_path / "cache", tell=told.append).run("work", make, (), ())
    before = stages._checksums(folder)
    do, words = DAMAGES[damage]
    do(folder)
    for cached in (False, True):
        del told[:]
        done = Stages(tmp_path / "cache", tell=told.append)
        assert done.run("work", make, (), ()) == folder and stages._checksums(folder) == before
        assert done.cached == {"work": cached} and (words in told[0]) is (not cached) and len(told) == (1 if cached else 3)
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_of_two_runs_at_once_the_first_keeps_its_place(work):
    def make(folder):
        (folder / "result.txt").write_text("x")
        if not first:  # while this run is at it, another one ends
            first.append(None)
            other = Stages(work.cache, tell=lambda line: None).run("work", make, (), ())
            first.append((other, os.stat(other).st_ino))

    first = []
    folder = Stages(work.cache, tell=lambda line: None).run("work", make, (), ())
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
        folder = done.run("work", work.make, (), ())
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


def test_where_the_cache_is(tmp_path, monkeypatch, toy_package):
    monkeypatch.delenv("ENHSIM_TF_CACHE", raising=False)
    assert default_cache() == Path.home() / ".cache" / "enhsim_tf"  # an installed package has no checkout around it
    (toy_package.parent / "pyproject.toml").touch()
    assert default_cache() == toy_package.parent / ".cache"
    monkeypatch.setenv("ENHSIM_TF_CACHE", str(tmp_path / "elsewhere"))
    assert default_cache() == tmp_path / "elsewhere"


def test_a_cache_that_cannot_be_written_is_a_users_mistake(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="writ"):
        Stages(tmp_path / "file" / "cache")


def test_imports_of_reads_every_form():
    source = "import os\nfrom enhsim_tf.noise.surrogates import a, b\nfrom enhsim_tf import signals, files as f\n"
    source += "from enhsim_tf.reproduce.paper.data import c\nfrom enhsim_tf.reproduce import report\n"
    source += "def g():\n    from enhsim_tf.enhancer.network import d\n    import numpy\n"
    source += (
        "LAZY = {'limit check': 'enhsim_tf.detection.detectors:LimitCheck'}\nOTHER = 'enhsim_tf.detection.metrics', 'other.detectors:A'\n"
    )
    assert sorted(imports_of(source)) == [
        "detection.detectors",
        "enhancer.network",
        "files",
        "noise.surrogates",
        "reproduce.paper.data",
        "reproduce.report",
        "signals",
    ]


def test_the_modules_of_every_stage_import_in_a_form_that_its_hash_follows():
    waiting, seen = {module for modules in vars(pipeline).values() if isinstance(modules, tuple) for module in modules}, set()
    while waiting - seen:
        seen.add(module := (waiting - seen).pop())
        source = stages._file_of(module).read_text(encoding="utf-8")  # each name is a module's
        waiting |= set(imports_of(source))
        for node in ast.walk(ast.parse(source)):
            assert not (isinstance(node, ast.Import) and any(alias.name.startswith("enhsim_tf") for alias in node.names)), module
            assert not (isinstance(node, ast.ImportFrom) and node.level), module
    networks = {
        "enhancer.network",
        "keras_tools.training",
        "keras_tools.blockwise_training",
        "keras_tools.convolution_maximum",
        "noise.gan",
        "noise.generator",
        "noise.discriminator",
        "noise.extraction",
        "coarse_simulator.square_waves",
        "telemetry.series",
        "telemetry.parquet_store",
        "reproduce.paper.signals",
        "realism.measures",
        "detection.detectors",
    }
    assert networks <= seen


def test_how_the_networks_are_put_together_is_part_of_the_measured_stages(tmp_path, monkeypatch):
    shutil.copytree(PACKAGE, tmp_path / "enhsim_tf")
    monkeypatch.setattr(stages, "_PACKAGE", tmp_path / "enhsim_tf")

    def key():
        return Stages(tmp_path / "cache", tell=lambda line: None).run("work", lambda folder: None, pipeline._MEASURED, ()).name

    before = key()
    (module,) = (file for file in (tmp_path / "enhsim_tf" / "reproduce").rglob("*.py") if "return EnhancedSimulator(" in file.read_text())
    module.write_text(module.read_text().replace("return EnhancedSimulator(", "return 2 * EnhancedSimulator("))
    assert key() != before, f"what the claims are measured on was changed in {module.name}, and the cache does not see it"
