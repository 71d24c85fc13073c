"""The arithmetic of the benchmarks, their table, and the processes that they time."""

import json

import pytest

from benchmarks import rows
from benchmarks.__main__ import main
from benchmarks.report import speed_table
from benchmarks.worker import Worker


def test_ways_take_turns():
    calls = []
    found = rows.in_turns(
        {
            "a": lambda: calls.append("a") or len(calls),
            "b": lambda: calls.append("b") or len(calls),
        },
        3,
    )
    assert "".join(calls) == "baabba"
    assert found == {"a": [2, 3, 6], "b": [1, 4, 5]}


def test_a_row_compares_neighbours():
    row = rows.compared("work", [0.001, 0.002, 0.009], "other", [0.002, 0.002, 0.003], target=0.9)
    assert row["ours"] == {"median": 2.0, "low": 1.0, "high": 9.0}
    assert row["ratio"] == pytest.approx({"median": 1.0, "low": 0.5, "high": 3.0})
    skipped = {"work": "a", "comparison": "b", "skipped": "no c"}
    assert speed_table([row, row | {"target": 1.0}, row | {"target": None}, skipped]).splitlines()[
        2:
    ] == [
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) | at most 0.90 | **no** |",
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) | at most 1.00 | yes |",
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) |  |  |",
        "| a |  | b | skipped: no c |  |  |",
    ]


def test_a_worker_times_its_work_or_says_why_it_is_skipped(monkeypatch, tmp_path):
    (tmp_path / "torch.py").write_text("raise ImportError('no torch here')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert Worker("torch_enhancer", "enhancer_step", num_steps=1).skipped == "no torch here"
    worker = Worker("examples", "copy", num_bytes=8_000)
    assert worker.skipped is None and worker.repeat() > 0
    worker.close()


def test_a_run_writes_its_rows(tmp_path, monkeypatch, capsys):
    row = rows.compared("work", [1.0], "other", [2.0], "s")
    for name in ("enhancer", "gan", "generation", "starting"):
        monkeypatch.setattr(rows, name, lambda: [row])
    assert main(["--out", str(tmp_path / "results.json")]) == 0
    found = json.loads((tmp_path / "results.json").read_text())
    assert found["rows"] == 4 * [row] and found["machine"]["cores"] > 0
    assert "0.50 (0.50 to 0.50)" in capsys.readouterr().out
