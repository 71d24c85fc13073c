"""Atomic writing: files and folders appear completely or not at all."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from enhsim_tf.common import atomic_files
from enhsim_tf.common.atomic_files import (
    remove_leftovers,
    replace_file,
    replace_files,
    replace_folder,
)
from tests.clone import ROOT, python

KILLED = """
import os, signal, sys
from enhsim_tf.common import atomic_files
rename, calls = os.replace, []
def killed(source, destination):
    rename(source, destination)
    calls.append(source)
    if len(calls) == int(sys.argv[1]):
        os.kill(os.getpid(), signal.SIGKILL)
os.replace = killed
"""
"""A process that is killed after so many renames."""


def content_of(folder):
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in folder.rglob("*")
        if path.is_file()
    }


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def put(path, text="new"):
    """Writes a folder with one file."""
    with replace_folder(path) as temporary:
        (temporary / "inside").write_text(text)


def is_only(folder, name, text):
    """Whether a folder holds nothing but a folder with one file."""
    return content_of(folder) == {f"{name}/inside": text} and names_in(folder) == [name]


def run(script, renames, *paths):
    """The exit code of a process that is killed after so many renames."""
    return python(KILLED + script, str(renames), *map(str, paths)).returncode


def killed(path, what, renames):
    """Writes a file or a folder in a process that is killed after so many renames; after none, when
    it has written half.
    """
    script = f"""
with atomic_files.replace_{what}(sys.argv[2]) as temporary:
    (temporary / "inside" if "{what}" == "folder" else temporary).write_text("new")
    if sys.argv[1] == "0":
        os.kill(os.getpid(), signal.SIGKILL)
"""
    assert run(script, renames, path) == -9


def test_a_new_folder_that_stays_empty_is_removed_and_others_are_kept(tmp_path):
    (tmp_path / "old").mkdir()
    with pytest.raises(ValueError), atomic_files.removing_empty(tmp_path / "old" / "a" / "b"):
        atomic_files.make_folder(tmp_path / "old" / "a" / "b")
        raise ValueError
    with atomic_files.removing_empty(tmp_path / "full" / "new"):
        atomic_files.make_folder(tmp_path / "full" / "new")
        (tmp_path / "full" / "kept").touch()
    with atomic_files.removing_empty(tmp_path / "old"):
        pass
    assert content_of(tmp_path) == {"full/kept": ""}
    assert names_in(tmp_path) == ["full", "old"] and not names_in(tmp_path / "old")


def test_a_folder_is_made_with_its_parents_and_refused_in_place_of_a_file(tmp_path, refused):
    folder = atomic_files.make_folder(tmp_path / "a" / "b")
    assert folder == tmp_path / "a" / "b" and not names_in(folder)
    assert atomic_files.make_folder(folder) == folder  # calling it again is not an error
    (folder / "taken").write_text("x")
    for path in (folder / "taken", folder / "taken" / "below"):
        with refused("taken"):
            atomic_files.make_folder(path)
    assert content_of(folder) == {"taken": "x"}


@pytest.mark.parametrize("before", ["nothing", "a folder", "a file", "a link"])
def test_replace_folder_replaces_whatever_is_there(tmp_path, before):
    path = tmp_path / "above" / "model"
    (tmp_path / "elsewhere").mkdir()
    path.parent.mkdir()
    if before == "a folder":
        path.mkdir()
        (path / "only_old").touch()
    elif before == "a file":
        path.touch()
    elif before == "a link":
        path.symlink_to(tmp_path / "elsewhere")
    put(path)
    assert content_of(tmp_path) == {"above/model/inside": "new"}
    assert names_in(path.parent) == ["model"]


@pytest.mark.parametrize("what", ["file", "folder"])
@pytest.mark.parametrize("before", [False, True])
def test_an_interrupt_keeps_the_old_content(tmp_path, what, before):
    path = tmp_path / "kept"
    inside = path / "inside" if what == "folder" else path
    if before:
        inside.parent.mkdir(exist_ok=True)
        inside.write_text("old")
    replace = {"file": replace_file, "folder": replace_folder}[what]
    with pytest.raises(KeyboardInterrupt), replace(path) as temporary:
        (temporary / "inside" if what == "folder" else temporary).write_text("half")
        raise KeyboardInterrupt
    assert list(content_of(tmp_path).values()) == ["old"] * before
    assert len(names_in(tmp_path)) == before


def test_a_failure_between_the_two_renames_restores_the_old_content(tmp_path, monkeypatch):
    rename, calls = os.replace, []
    put(tmp_path / "model", "old")

    def fails(source, destination):
        calls.append(source)
        if len(calls) == 2:
            raise OSError("no space left")
        rename(source, destination)

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(OSError, match="no space"):
        put(tmp_path / "model")
    assert is_only(tmp_path, "model", "old")


@pytest.mark.parametrize("then", ["remove_leftovers", "replace_folder"])
@pytest.mark.parametrize("renames", [0, 1])  # while it writes, and between its renames
def test_a_kill_leaves_the_old_content(tmp_path, then, renames):
    path = tmp_path / "model.v2"
    put(path, "old")
    killed(path, "folder", renames)
    assert path.exists() == (renames == 0) and len(names_in(tmp_path)) > 1
    if then == "remove_leftovers":
        remove_leftovers(tmp_path)
    else:
        with pytest.raises(RuntimeError), replace_folder(path):
            raise RuntimeError
    assert is_only(tmp_path, "model.v2", "old")


def test_files_that_a_killed_process_left_are_removed(tmp_path):
    for name in ("results.json", "without"):
        killed(tmp_path / name, "file", 0)
    remove_leftovers(tmp_path, "without")
    assert {name.startswith(".results.json.") for name in names_in(tmp_path)} == {True}
    remove_leftovers(tmp_path)
    assert not names_in(tmp_path)


def test_what_a_running_process_writes_is_no_leftover(tmp_path):
    with replace_folder(tmp_path / "model") as temporary, replace_file(tmp_path / "notes") as notes:
        (temporary / "inside").write_text("new")
        notes.write_text("new")
        put(tmp_path / "model", "other")
        remove_leftovers(tmp_path)
    assert content_of(tmp_path) == {"model/inside": "new", "notes": "new"}


def test_files_that_only_look_like_leftovers_stay(tmp_path):
    mine = [".photos.20240101.tmp", ".model.old", ".enhsim_tf", ".mine.enhsim_tf", "model"]
    for name in mine:
        (tmp_path / name).mkdir()
    remove_leftovers(tmp_path)
    assert names_in(tmp_path) == sorted(mine)


def test_replace_folder_keeps_the_old_content_if_keep_says_so(tmp_path):
    def is_whole(folder):
        return (folder / "inside").read_text() == "whole"

    for text, expected in (("broken", "broken"), ("whole", "whole"), ("other", "whole")):
        with replace_folder(tmp_path / "stage", is_whole) as temporary:
            (temporary / "inside").write_text(text)
        assert is_only(tmp_path, "stage", expected)


def test_many_writers_at_once_leave_one_whole_folder(tmp_path):
    script = """
import sys
from enhsim_tf.common.atomic_files import replace_folder
for number in range(50):
    with replace_folder(sys.argv[1]) as temporary:
        for name in "ab":
            (temporary / name).write_text(sys.argv[2])
"""
    writers = [
        subprocess.Popen([sys.executable, "-c", script, str(tmp_path / "model"), name], cwd=ROOT)
        for name in ("x", "y", "z")
    ]
    assert [writer.wait() for writer in writers] == [0, 0, 0]
    assert len(set(content_of(tmp_path).values())) == 1 and names_in(tmp_path) == ["model"]


def test_json_without_nan_and_its_checksum(tmp_path):
    path = tmp_path / "results.json"
    atomic_files.write_json(path, {"a": [1, 2.5, None, "é"]})
    with pytest.raises(ValueError, match="not JSON compliant"):
        atomic_files.write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": [1, 2.5, None, "é"]}
    assert names_in(tmp_path) == ["results.json"]
    path.write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    assert (
        atomic_files.sha256(path)
        == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    )


def two_files(folder, before):
    """The paths of two files, which are there before or not."""
    paths = [folder / "one", folder / "two"]
    for path in paths if before else ():
        path.write_text("old")
    return paths


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("fails", ["one", "two"])
def test_files_that_belong_together_are_replaced_together_or_not_at_all(
    tmp_path, monkeypatch, before, fails
):
    paths, rename = two_files(tmp_path, before), os.replace
    kept = content_of(tmp_path)

    def failing(source, destination):
        if Path(destination).name == fails and Path(source).read_text() == "new":
            raise OSError("no space left")
        rename(source, destination)

    monkeypatch.setattr(atomic_files.os, "replace", failing)

    def replace():
        with replace_files(*paths) as temporaries:
            for temporary in temporaries:
                temporary.write_text("new")

    with pytest.raises(OSError, match="no space left"):
        replace()
    assert content_of(tmp_path) == kept
    monkeypatch.undo()
    replace()
    assert content_of(tmp_path) == {"one": "new", "two": "new"}


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("renames", range(1, 6))
def test_a_kill_between_renames_leaves_all_old_files_or_all_new_ones(tmp_path, before, renames):
    paths = two_files(tmp_path, before)
    old = content_of(tmp_path)
    script = """
with atomic_files.replace_files(*sys.argv[2:]) as temporaries:
    for temporary in temporaries:
        temporary.write_text("new")
"""
    # the list of what is to be undone is the first rename; each old file takes one more
    is_done = renames > 1 + 2 * (1 + before)
    assert run(script, renames, *paths) == (0 if is_done else -9)
    remove_leftovers(tmp_path)
    assert content_of(tmp_path) == ({"one": "new", "two": "new"} if is_done else old)
    assert names_in(tmp_path) == sorted(content_of(tmp_path))
