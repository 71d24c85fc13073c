"""Tests of atomic writing: files and folders appear completely or not at all."""

import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from enhsim_tf.common import atomic_files

ROOT = Path(__file__).parents[2]


each_way = pytest.mark.parametrize("can_exchange", [True, False], ids=["exchanged", "two renames"], indirect=True)


@pytest.fixture
def can_exchange(request, monkeypatch):
    """Runs a test with the exchange in one step and with the two renames."""
    if not request.param:
        monkeypatch.setattr(atomic_files, "_exchange", lambda first, second: False)
    return request.param


def content_of(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_make_folder_creates_parents_and_leaves_the_folder_empty(tmp_path):
    folder = atomic_files.make_folder(tmp_path / "a" / "b")
    assert folder == tmp_path / "a" / "b" and folder.is_dir() and not list(folder.iterdir())
    assert atomic_files.make_folder(folder) == folder  # calling it again is not an error


def test_make_folder_refuses_an_existing_file(tmp_path, refused):
    (tmp_path / "taken").write_text("x")
    with refused("taken"):
        atomic_files.make_folder(tmp_path / "taken")
    with refused("taken"):
        atomic_files.make_folder(tmp_path / "taken" / "below")
    assert content_of(tmp_path) == {"taken": "x"}


def test_replace_file_renames_only_at_the_end(tmp_path):
    path = tmp_path / "values.json"
    path.write_text("old")
    with atomic_files.replace_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
        assert temporary.parent == path.parent and temporary.suffix == ".json"
    assert content_of(tmp_path) == {"values.json": "new"}


@pytest.mark.parametrize("before", [{}, {"values.json": "old"}])
def test_interrupted_replace_file_keeps_the_old_content(tmp_path, before):
    for name, text in before.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(KeyboardInterrupt), atomic_files.replace_file(tmp_path / "values.json") as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert content_of(tmp_path) == before


@each_way
def test_replace_folder_replaces_the_whole_old_folder(can_exchange, tmp_path):
    path = tmp_path / "above" / "model"
    for number in (1, 2):
        with atomic_files.replace_folder(path) as temporary:
            (temporary / f"only_{number}").write_text(str(number))
    assert content_of(tmp_path) == {"above/model/only_2": "2"}


@each_way
def test_replace_folder_replaces_a_file_and_leaves_no_temporary(can_exchange, tmp_path):
    path = tmp_path / "model"
    path.write_text("a file")
    with atomic_files.replace_folder(path) as temporary:
        (temporary / "inside").write_text("new")
    assert content_of(tmp_path) == {"model/inside": "new"}


@pytest.mark.parametrize("before", [{}, {"model/inside": "old"}])
def test_interrupted_replace_folder_keeps_the_old_content(tmp_path, before):
    for name, text in before.items():
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text)
    with pytest.raises(KeyboardInterrupt), atomic_files.replace_folder(tmp_path / "model") as temporary:
        (temporary / "inside").write_text("half")
        raise KeyboardInterrupt
    assert content_of(tmp_path) == before
    assert len(list(tmp_path.iterdir())) == len(before)


@pytest.mark.parametrize("can_exchange", [False], indirect=True)
def test_replace_folder_keeps_the_old_content_when_the_rename_fails(can_exchange, tmp_path, monkeypatch):
    path = tmp_path / "model"
    path.mkdir()
    (path / "inside").write_text("old")
    rename, calls = os.replace, []

    def fails_for_the_new(source, destination):
        calls.append(source)
        if Path(destination) == path and len(calls) == 2:
            raise OSError("no space left")
        rename(source, destination)

    monkeypatch.setattr(os, "replace", fails_for_the_new)
    with pytest.raises(OSError, match="no space left"), atomic_files.replace_folder(path) as temporary:
        (temporary / "inside").write_text("new")
    assert content_of(tmp_path) == {"model/inside": "old"}


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_killed_process_leaves_the_old_content(tmp_path, kind):
    path = tmp_path / "kept"
    if kind == "folder":
        path.mkdir()
    inside = path / "inside" if kind == "folder" else path
    inside.write_text("old")
    script = f"""
import os, signal, sys
from enhsim_tf.common.atomic_files import replace_{kind}
with replace_{kind}(sys.argv[1]) as temporary:
    (temporary / "inside" if "{kind}" == "folder" else temporary).write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    ended = subprocess.run([sys.executable, "-c", script, str(path)], cwd=ROOT)
    assert ended.returncode == -9
    assert inside.read_text() == "old"


@pytest.mark.parametrize("kind", ["file", "folder"])
@pytest.mark.parametrize("then", ["remove_leftovers", "replace_folder"])
def test_old_content_is_restored_after_a_kill_between_the_two_renames(tmp_path, kind, then):
    path = tmp_path / "model.v2"
    if kind == "folder":
        path.mkdir()
    inside = path / "inside" if kind == "folder" else path
    inside.write_text("old")
    script = """
import os, signal, sys
from enhsim_tf.common import atomic_files
atomic_files._exchange = lambda first, second: False
rename = os.replace
def killed(source, destination):
    rename(source, destination)
    if str(destination).endswith(".old"):
        os.kill(os.getpid(), signal.SIGKILL)
os.replace = killed
with atomic_files.replace_folder(sys.argv[1]) as temporary:
    (temporary / "inside").write_text("new")
"""
    assert subprocess.run([sys.executable, "-c", script, str(path)], cwd=ROOT).returncode == -9
    assert not path.exists() and len(list(tmp_path.iterdir())) == 2
    if then == "remove_leftovers":
        atomic_files.remove_leftovers(tmp_path)
    else:
        with pytest.raises(RuntimeError), atomic_files.replace_folder(path):
            raise RuntimeError
    assert inside.read_text() == "old" and [each.name for each in tmp_path.iterdir()] == ["model.v2"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere a folder takes two renames")
def test_a_reader_always_finds_the_old_or_the_new_content(tmp_path):
    path = tmp_path / "model"
    with atomic_files.replace_folder(path) as temporary:
        (temporary / "number").write_text("0")
    script = """
import sys
from enhsim_tf.common.atomic_files import replace_folder
for number in range(1, 301):
    with replace_folder(sys.argv[1]) as temporary:
        (temporary / "number").write_text(str(number))
"""
    writer = subprocess.Popen([sys.executable, "-c", script, str(path)], cwd=ROOT)
    missed, reads = 0, 0
    while writer.poll() is None:
        missed, reads = missed + (not path.is_dir()), reads + 1
    assert writer.returncode == 0 and (path / "number").read_text() == "300"
    assert reads > 300 and missed == 0 and [each.name for each in tmp_path.iterdir()] == ["model"]


@each_way
def test_replace_folder_keeps_the_old_content_if_keep_says_so(can_exchange, tmp_path):
    path, asked = tmp_path / "stage", []

    def keep(found):
        asked.append((found / "inside").read_text())
        return asked[-1] == "whole"

    for text, expected in (("broken", "broken"), ("whole", "whole"), ("other", "whole")):
        with atomic_files.replace_folder(path, keep) as temporary:
            (temporary / "inside").write_text(text)
        assert content_of(tmp_path) == {"stage/inside": expected}
    assert asked == ["broken", "whole"] and [each.name for each in tmp_path.iterdir()] == ["stage"]


@pytest.mark.parametrize("can_exchange", [False], indirect=True)
def test_replace_folder_replaces_a_folder_written_by_another_process_in_the_meantime(can_exchange, tmp_path, monkeypatch):
    path, rename = tmp_path / "model", os.replace
    path.mkdir()

    def meanwhile(source, destination):
        rename(source, destination)
        if str(destination).endswith(".old") and not asked:
            asked.append(destination)
            path.mkdir()
            (path / "inside").write_text("of another")

    asked = []
    monkeypatch.setattr(os, "replace", meanwhile)
    with atomic_files.replace_folder(path) as temporary:
        (temporary / "inside").write_text("new")
    assert content_of(tmp_path) == {"model/inside": "new"} and [each.name for each in tmp_path.iterdir()] == ["model"]


@each_way
def test_replace_folder_replaces_a_link_and_not_its_target(can_exchange, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "model").symlink_to("elsewhere")
    with atomic_files.replace_folder(tmp_path / "model") as temporary:
        (temporary / "inside").write_text("new")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["elsewhere", "model"] and content_of(tmp_path) == {"model/inside": "new"}


def test_files_that_a_killed_process_left_are_removed(tmp_path):
    script = (
        "import os, signal, sys\nfrom enhsim_tf.common.atomic_files import replace_file\nwith replace_file(sys.argv[1]) as temporary:\n"
    )
    script += "    temporary.write_text('half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    for name in ("results.json", "without"):
        subprocess.run([sys.executable, "-c", script, str(tmp_path / name)], cwd=ROOT)
    assert len(list(tmp_path.iterdir())) == 2
    atomic_files.remove_leftovers(tmp_path, "without")
    assert [each.name.startswith(".results.json.") for each in tmp_path.iterdir()] == [True]
    atomic_files.remove_leftovers(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("days", [-400, 400])
def test_a_wrong_clock_does_not_remove_files_of_a_running_process(tmp_path, monkeypatch, days):
    alive = left_by(os.getppid(), tmp_path)
    other = left_by(dead_process(), tmp_path, "another-machine")
    grow_old(alive, days)  # as if the clock had been changed
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + days * 86_400)  # the local clock is wrong, the file system's clock is right
    atomic_files.remove_leftovers(tmp_path)
    assert alive.is_dir() and other.is_dir()


def test_write_json_round_trip_and_refusal_of_nan_and_infinity(tmp_path):
    path = tmp_path / "results.json"
    atomic_files.write_json(path, {"a": [1, 2.5, None, "é"]})
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": [1, 2.5, None, "é"]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        atomic_files.write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text(encoding="utf-8"))["a"][1] == 2.5
    assert [entry.name for entry in tmp_path.iterdir()] == ["results.json"]


def test_sha256_of_the_standard_s_examples(tmp_path):
    path = tmp_path / "message"
    path.write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    assert atomic_files.sha256(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    path.write_bytes(b"a" * 1_000_000)  # appendix B.3
    assert atomic_files.sha256(path) == "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"
    assert atomic_files.sha256(path) == hashlib.sha256(path.read_bytes()).hexdigest()


def left_by(process, folder, host=None):
    """Creates what a killed process leaves: a temporary folder with a file in it."""
    left = folder / f".stage-0123.{host or atomic_files._host()}.{process}.0123abcd.tmp"
    (left / "below").mkdir(parents=True)
    (left / "below" / "half").write_text("half")
    return left


def dead_process():
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


def grow_old(folder, days):
    for path in (folder, *folder.rglob("*")):
        os.utime(path, (path.stat().st_atime, path.stat().st_mtime - days * 86_400))


def test_leftovers_of_a_killed_process_are_removed(tmp_path):
    script = (
        "import os, signal, sys\nfrom enhsim_tf.common.atomic_files import replace_folder\nwith replace_folder(sys.argv[1]) as temporary:\n"
    )
    script += "    (temporary / 'half').write_text('half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "stage-0123")], cwd=ROOT)
    assert [path.name for path in tmp_path.glob(".stage-0123.*/*")] == ["half"]
    atomic_files.remove_leftovers(tmp_path)
    assert not list(tmp_path.iterdir())


def test_leftovers_of_unknown_processes_stay_for_a_day(tmp_path):
    others = [left_by(os.getpid(), tmp_path), left_by(dead_process(), tmp_path, "another-machine")]
    for days in (0, 0.9):
        for left in others:
            grow_old(left, days)
        atomic_files.remove_leftovers(tmp_path)
        assert all(left.is_dir() for left in others)
    for left in others:
        grow_old(left, 0.2)
    (others[0] / "below" / "new").write_text("at work")
    atomic_files.remove_leftovers(tmp_path)
    assert [left.is_dir() for left in others] == [True, False]


def test_files_that_only_look_like_leftovers_stay(tmp_path):
    mine = [".photos.20240101.tmp", ".model.20240101.old", ".notes.20240101.old", ".notes.2024.20240101.old"]
    for name in mine:
        (tmp_path / name).mkdir()
        (tmp_path / name / "kept").write_text("mine")
        grow_old(tmp_path / name, 400)
    (tmp_path / "model").mkdir()
    atomic_files.remove_leftovers(tmp_path)
    assert sorted(path.parent.name for path in tmp_path.glob("*/kept")) == sorted(mine)


def test_leftovers_of_exchanged_files_and_links_are_removed(tmp_path):
    script = """
import os, signal, sys
from enhsim_tf.common import atomic_files
atomic_files._remove = lambda path: os.kill(os.getpid(), signal.SIGKILL)
with atomic_files.replace_folder(sys.argv[1]) as temporary:
    (temporary / "inside").write_text("new")
"""
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("file", "link"):
        assert subprocess.run([sys.executable, "-c", script, str(tmp_path / name)], cwd=ROOT).returncode == -9
    atomic_files.remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link"]
    assert [(tmp_path / name / "inside").read_text() for name in ("file", "link")] == ["new", "new"]


@pytest.mark.parametrize("can_exchange", [False], indirect=True)
def test_interrupted_between_the_two_renames_the_old_content_stays(can_exchange, tmp_path, monkeypatch):
    path, rename = tmp_path / "model", os.replace
    path.mkdir()
    (path / "inside").write_text("old")

    def interrupted(source, destination):
        rename(source, destination)
        if str(destination).endswith(".old"):
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), atomic_files.replace_folder(path) as temporary:
        (temporary / "inside").write_text("new")
    assert content_of(tmp_path) == {"model/inside": "old"} and [each.name for each in tmp_path.iterdir()] == ["model"]


def test_machines_with_similar_names_are_distinguished(monkeypatch):
    seen = []
    for name in ("gke-prod-cluster-default-pool-aaaa", "gke-prod-cluster-default-pool-bbbb", "x", ""):
        monkeypatch.setattr(atomic_files.socket, "gethostname", lambda name=name: name)
        seen.append(atomic_files._host.__wrapped__())
    assert len(set(seen)) == 4 and max(map(len, seen)) <= 17 and not any("." in each for each in seen)


def test_the_longest_name_still_allows_two_temporary_suffixes(tmp_path):
    path = tmp_path / atomic_files.encode_name("a" * 160)
    with (
        atomic_files.replace_folder(path) as outer,
        atomic_files.replace_folder(outer) as inner,
        atomic_files.replace_file(inner / "settings.json") as temporary,
    ):
        temporary.write_text("{}")
    assert (path / "settings.json").read_text() == "{}"


def test_no_other_name_counts_as_a_leftover(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "kept").write_text("x")
    (tmp_path / "stage-0123").mkdir()
    (tmp_path / ".mine.tmp").mkdir()
    for path in tmp_path.iterdir():
        if not path.is_symlink():
            grow_old(path, 2)
    before = sorted(tmp_path.rglob("*"))
    atomic_files.remove_leftovers(tmp_path)
    assert sorted(tmp_path.rglob("*")) == before
