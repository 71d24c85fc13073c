"""Large data sets: identical bytes after any interruption, detection of damage, and reading of the
files.
"""

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.common import console
from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.datasets import generate, labelled_windows
from enhsim_tf.datasets.generate import find_problems, generate_data_set, locked
from enhsim_tf.datasets.labelled_windows import make_plan, shard_file
from enhsim_tf.datasets.places import ScenarioRange
from enhsim_tf.simulator.simulator import EnhancedSimulator
from tests.clone import ROOT, blocks_of
from tests.small_data_set import SCENARIOS, PlainMaker, plain, plan

COMMAND = ROOT / "tests" / "small_data_set.py"


def serial(engine, work, numbers, workers=None):
    """An engine that computes in this process."""
    yield from map(work, numbers)


@pytest.fixture
def here(monkeypatch):
    """Generates data sets in this process. The fixture lists the shards that were generated."""
    made = []

    class Maker(PlainMaker):
        def __call__(self, shard):
            made.append(shard)
            return super().__call__(shard)

    monkeypatch.setattr(generate, "ShardMaker", Maker)
    monkeypatch.setattr(generate.engines, "run", serial)
    return made


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The data set of 1,000 windows of `small_data_set.py`, generated without interruption."""
    folder = tmp_path_factory.mktemp("undisturbed") / "set"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generate, "ShardMaker", PlainMaker)
        patch.setattr(generate.engines, "run", serial)
        generate_data_set(folder, plan(), tell=lambda line: None)
    return folder


def content_of(folder):
    return {path.name: sha256(path) for path in folder.iterdir()}


def told(folder, asked):
    """Generates a data set and returns the lines of output."""
    lines = []
    generate_data_set(folder, asked, tell=lines.append)
    return lines


@pytest.fixture
def copied(undisturbed, tmp_path):
    """A copy of the undisturbed data set."""
    return Path(shutil.copytree(undisturbed, tmp_path / "set"))


# what is written


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize(("damage", "damaged"), [(None, []), (Path.unlink, [3, 7]), (flip, [3, 7])])
def test_damaged_and_missing_shards_are_found_and_generated_again(
    damage, damaged, undisturbed, copied, here
):
    for shard in damaged:
        damage(copied / shard_file(shard))
    assert [line.split(":")[0] for line in find_problems(copied)] == list(map(shard_file, damaged))
    assert told(copied, plan())[0].startswith(f"{20 - len(damaged)} of 20 shards")
    assert here == damaged
    assert content_of(copied) == content_of(undisturbed) and not list(find_problems(copied))


@pytest.fixture
def begun(copied):
    """An unfinished data set, as left by a killed run."""
    manifest = json.loads((copied / "_manifest.json").read_text()) | {"shards": None}
    (copied / "_manifest.json").write_text(json.dumps(manifest))
    for shard in set(range(20)) - {0, 1, 2, 5}:
        (copied / shard_file(shard)).unlink()
    (copied / f".{shard_file(9)}.0123abcd.enhsim_tf.parquet").write_bytes(b"half")
    return copied


def test_a_run_resumes_after_the_finished_shards(begun, undisturbed, here):
    PlainMaker(plan(seed=4), begun)(1)  # of another plan
    PlainMaker(plan(130), begun)(2)  # of the same one, but shorter
    (begun / shard_file(3)).write_bytes((begun / shard_file(5)).read_bytes()[:-9])
    (begun / shard_file(4)).write_bytes(b"")
    assert list(find_problems(begun)) == [
        "not finished: 6 of 20 shards are there; run the same `generate` again"
    ]
    assert told(begun, plan())[0].startswith("2 of 20 shards")
    assert here == [shard for shard in range(20) if shard not in (0, 5)]
    assert content_of(begun) == content_of(undisturbed)


def test_a_long_run_says_how_far_it_is(tmp_path, monkeypatch, here):
    monkeypatch.setattr(console, "INTERVAL_S", 0.0)
    lines = told(tmp_path / "set", plan(150))
    assert any(line.startswith("window 50 of 150, 33 %, about ") for line in lines)


@pytest.mark.parametrize(
    "content",
    [b"{", b"[]", b"\xff", b'{"format": "enhsim_tf.datasets.generate/5", "settings": {}}'],
)
def test_a_damaged_manifest_gives_one_line_with_advice(content, copied, here, refused):
    (copied / "_manifest.json").write_bytes(content)
    for call in (lambda: generate_data_set(copied, plan()), lambda: list(find_problems(copied))):
        with refused("_manifest.json", "remove this one"):
            call()
    assert not here


def test_a_shard_written_to_the_disk_of_another_machine_is_an_error(tmp_path, monkeypatch, refused):
    monkeypatch.setattr(
        generate.engines, "run", lambda *arguments: (done for done in [(3, "0" * 64)])
    )
    with refused(shard_file(3), "all machines share"):
        generate_data_set(tmp_path / "set", plan())


def test_a_folder_is_held_against_the_same_process_too_and_let_go_of(tmp_path, refused):
    folder = tmp_path / "above" / "set"
    with locked(folder), refused("no other run", "Wait"), locked(folder):
        pass
    with pytest.raises(KeyError), locked(folder):
        raise KeyError
    with locked(folder):
        assert os.listdir(folder) == [".lock"]
    assert os.listdir(folder) == [".lock"]


# other folders


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (plan(seed=4), "seed as in"),
        (plan(2_000), "Received: 2000"),
        (plan(shard=100), "shard as in"),
        (plan(nominal=0.4), "nominal as in"),
        (plan(scenarios=SCENARIOS[:1]), 'Received: [{"mode": "stuck"'),
        (plan(checksum="1" * 64), "model as in"),
    ],
    ids=itertools.count(),
)
def test_a_data_set_with_other_settings_is_left_unchanged(other, words, begun, here, refused):
    before = content_of(begun)
    with refused(words, "--out"):
        generate_data_set(begun, other)
    assert content_of(begun) == before and not here


@pytest.mark.parametrize("name", ["shard-000000.parquet", "folder"])
def test_a_folder_with_other_content_is_left_unchanged(name, tmp_path, here, refused):
    (tmp_path / name).mkdir() if name == "folder" else (tmp_path / name).write_text("mine")
    with refused(name):
        generate_data_set(tmp_path, plan())
    assert [path.name for path in tmp_path.iterdir()] == [name] and not here


def test_verify_names_unexpected_files(copied):
    (copied / "shard-000020.parquet").touch()
    assert list(find_problems(copied)) == ["shard-000020.parquet: not a file of this data set"]


# real faults


def started(folder, *options, **how):
    return subprocess.Popen(
        [sys.executable, COMMAND, folder, *map(str, options)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **how,
    )


def children_of(process):
    """Returns the worker processes of a run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
            if (
                int(fields[1]) == process.pid
                and b"spawn_main" in (stat.parent / "cmdline").read_bytes()
            ):
                found.append(int(stat.parent.name))
        except OSError:  # the process has ended in the meantime
            continue
    return found


def is_one_error(text):
    return text.startswith("error: Expected ") and len(text.splitlines()) == 1


linux = pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="looks for processes in /proc"
)


FAULTS = [("driver", 6), ("worker", 6), ("interrupt", 2)]


@linux
@pytest.mark.parametrize(
    ("who", "seed"),
    [
        pytest.param(who, seed, marks=[pytest.mark.slow] * ((who, seed) != ("driver", 0)))
        for who, number in FAULTS
        for seed in range(number)
    ],
)
def test_killed_and_interrupted_runs_are_recovered_bit_for_bit(who, seed, undisturbed, tmp_path):
    folder, rng = tmp_path / "set", np.random.default_rng(seed)
    folder.mkdir()
    process, least = started(folder, start_new_session=True), rng.integers(1, 15)
    while len(list(folder.glob("shard-*"))) < least and process.poll() is None:
        time.sleep(0.002)
    time.sleep(rng.uniform(0, 0.03))
    workers = children_of(process)
    if who == "interrupt":
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get the signal too
    else:
        os.kill(process.pid if who == "driver" else workers[0], signal.SIGKILL)
    err = process.communicate()[1]
    assert process.returncode == {"driver": -signal.SIGKILL, "worker": 0, "interrupt": 130}[who]
    if who == "interrupt":
        assert err == "interrupted; what was finished is kept\n"
        assert not list(folder.glob(".shard*"))
    if who != "worker":
        again = started(folder)  # the workers of the killed driver may still be running
        again.communicate()
        assert again.returncode == 0
    assert content_of(folder) == content_of(undisturbed)
    deadline = time.monotonic() + 20
    while any(left := [Path(f"/proc/{worker}").exists() for worker in workers]):
        assert time.monotonic() < deadline, f"{sum(left)} workers of the killed driver still run"
        time.sleep(0.05)


@pytest.mark.slow
def test_a_full_disk_gives_one_line_and_a_later_run_finishes(undisturbed, tmp_path):
    folder = tmp_path / "set"
    # limits the size of files, which for a program looks like a full disk
    process = started(folder, "--limit", 9_000)
    _, err = process.communicate()
    assert process.returncode == 2 and is_one_error(err) and "large" in err
    assert not list(folder.glob("*shard*"))
    assert started(folder).wait() == 0 and content_of(folder) == content_of(undisturbed)


def test_a_read_only_folder_gives_one_line():
    as_another = ["--user", 65534] if os.geteuid() == 0 else []  # root may write anywhere
    # other users may enter this folder, unlike `tmp_path`
    with tempfile.TemporaryDirectory() as outer:
        folder = Path(outer) / "set"
        folder.mkdir()
        folder.chmod(0o555)
        Path(outer).chmod(0o755)
        process = started(folder, *as_another)
        out, err = process.communicate()
        assert (process.returncode, out, os.listdir(folder)) == (2, "", [])
        assert is_one_error(err) and "Permission denied" in err
        folder.chmod(0o755)


def test_a_second_run_into_the_same_folder_is_refused(tmp_path):
    with locked(tmp_path / "set"):
        second = started(tmp_path / "set")
        assert "no other run" in second.communicate()[1] and second.returncode == 2


# the command


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A folder with two saved simulators."""
    folder = tmp_path_factory.mktemp("models")
    for noise_sd, name in ((0.1, "volts"), (0.2, "amps")):
        plain(noise_sd, channels=(name,)).save(folder / name)
    return folder


def test_the_command_writes_the_same_bytes_as_one_process(models, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(labelled_windows, "_SHARD", 50)
    asked = f"generate {models}/volts --windows 150 --scenario friction:0-1 --seed 5"
    assert main(f"{asked} --workers 2 --out {tmp_path}/set".split()) == 0
    assert "volts: 150 windows of 60 samples in 3 shards in " in capsys.readouterr().out
    expected = tmp_path / "serial"
    simulator = EnhancedSimulator.load(models / "volts")
    friction = [ScenarioRange("friction", (0.0, 1.0))]
    monkeypatch.setattr(generate.engines, "run", serial)
    generate_data_set(expected, make_plan(simulator, models / "volts", friction, 0.5, 150, 5))
    assert content_of(tmp_path / "set") == content_of(expected)
    capsys.readouterr()
    assert main(["verify", str(tmp_path / "set")]) == 0
    assert capsys.readouterr().out == "150 windows in 3 shards, all intact\n"
    assert main(f"{asked} --out {tmp_path}/one.parquet".split()) == 0
    one = pd.read_parquet(tmp_path / "one.parquet")
    parts = pd.read_parquet(sorted(expected.glob("shard-*.parquet")))
    # other threads may round otherwise
    np.testing.assert_allclose(*(np.stack(each.pop("window")) for each in (one, parts)), atol=1e-6)
    pd.testing.assert_frame_equal(one, parts)


def test_the_engine_is_the_one_asked_for(models, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    words = f"generate {models}/volts --windows 5 --engine ray --out {tmp_path}/set"
    assert main(words.split()) == 2 and "pip install" in capsys.readouterr().err


def test_each_channel_has_a_data_set_of_its_own(models, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(generate, "ShardMaker", PlainMaker)
    monkeypatch.setattr(generate.engines, "run", serial)
    options = f"generate {models} --windows 1_000 --workers auto --scenario stuck:0.5 --seed 4"
    assert main(f"{options} --out {tmp_path}/both".split()) == 0
    assert main(f"{options} --channel volts --out {tmp_path}/one".split()) == 0
    assert sorted(os.listdir(tmp_path / "both")) == ["amps", "volts"]
    assert content_of(tmp_path / "both" / "volts") == content_of(tmp_path / "one")
    settings = json.loads((tmp_path / "one" / "_manifest.json").read_text())["settings"]
    assert (settings["seed"], settings["nominal"], settings["channels"]) == (4, 0.5, ["volts"])


# reading


DOCS = blocks_of("docs/large_data_sets.md")


@pytest.mark.parametrize(
    ("number", "library"), list(enumerate(("pandas", "pyarrow.dataset", "tensorflow")))
)
def test_the_reading_examples_of_the_documentation_return_the_data_set(
    number, library, undisturbed, monkeypatch
):
    monkeypatch.chdir(undisturbed.parent)
    code = DOCS[number].replace('"training"', '"set"')
    assert f"import {library}" in code and len(DOCS) == 3
    names = {}
    exec(compile(code, "docs/large_data_sets.md", "exec"), names)
    table = pd.read_parquet(sorted(undisturbed.glob("shard-*.parquet")))
    windows, nominal = np.stack(table["window"]), (table["scenario"] == "nominal").to_numpy()
    if library == "pandas":
        assert np.array_equal(names["windows"], windows) and len(names["table"]) == 1_000
    elif library == "pyarrow.dataset":
        stuck = table[(table["scenario"] == "stuck") & (table["severity"] > 0.5)]
        assert names["stuck"].num_rows == len(stuck) > 0
        assert names["num_windows"] == 1_000
    else:
        batches = list(names["data"].as_numpy_iterator())
        assert np.array_equal(np.concatenate([batch for batch, _ in batches]), windows)
        assert np.array_equal(np.concatenate([label for _, label in batches]), ~nominal)
