"""The arithmetic of the benchmarks, their table, and the processes that they time."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import rows
from benchmarks.__main__ import main
from benchmarks.machine import instruction_sets
from benchmarks.report import speed_table
from benchmarks.worker import Worker

ROOT = Path(__file__).parents[2]


def test_ways_take_turns():
    calls = []
    found = rows.in_turns({"a": lambda: calls.append("a") or len(calls), "b": lambda: calls.append("b") or len(calls)}, 3)
    assert "".join(calls) == "baabba"
    assert found == {"a": [2, 3, 6], "b": [1, 4, 5]}


def test_a_row_compares_neighbours():
    row = rows.compared("work", [0.001, 0.002, 0.009], "other", [0.002, 0.002, 0.003], target=0.9)
    assert row["ours"] == {"median": 2.0, "low": 1.0, "high": 9.0}
    assert row["ratio"] == pytest.approx({"median": 1.0, "low": 0.5, "high": 3.0})
    skipped = {"work": "a", "comparison": "b", "skipped": "no c"}
    assert speed_table([row, row | {"target": 1.0}, row | {"target": None}, skipped]).splitlines()[2:] == [
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) | at most 0.90 | **no** |",
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) | at most 1.00 | yes |",
        "| work | 2 ms | other | 1.00 (0.50 to 3.00) |  |  |",
        "| a |  | b | skipped: no c |  |  |",
    ]


def test_the_traffic_and_the_work_of_the_enhancer():
    layers = [(500, 500), (500, 3_200), (3_200, 3_200), (3_200, 500)]
    assert rows.PARAMETERS == sum(inputs * outputs + outputs for inputs, outputs in layers)
    assert rows.WINDOW_FLOP == 2 * sum(inputs * outputs for inputs, outputs in layers)


def test_a_worker_times_its_work_or_says_why_it_is_skipped(monkeypatch, tmp_path):
    (tmp_path / "torch.py").write_text("raise ImportError('no torch here')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert Worker("torch_enhancer", "enhancer_step", num_steps=1).skipped == "no torch here"
    worker = Worker("tool", "product_gather_sum", num_windows=20)
    assert worker.skipped is None and worker.repeat() > 0
    worker.close()


@pytest.mark.parametrize("arguments", [["--quick"], ["--only", "gan"]])
def test_a_partial_run_does_not_replace_the_results(arguments, capsys):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2 and "another --out" in capsys.readouterr().err


def test_help_needs_no_tensorflow():
    program = "import sys, benchmarks.__main__\nassert 'tensorflow' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


def test_a_run_writes_its_rows(tmp_path, monkeypatch, capsys):
    row = rows.compared("work", [1.0], "other", [2.0], "s")
    monkeypatch.setattr(rows, "starting", lambda budget: [row] if budget == rows.QUICK else [])
    assert main(["--quick", "--only", "starting", "--out", str(tmp_path / "results.json")]) == 0
    assert json.loads((tmp_path / "results.json").read_text())["rows"] == [row]
    assert "0.50 (0.50 to 0.50)" in capsys.readouterr().out


def test_instruction_sets_of_a_processor():
    cpuinfo = "model name\t: Some Processor\nflags\t\t: fpu sse4_2 avx2 fma avx512f avx512_vnni hypervisor\nprocessor\t: 1\n"
    assert instruction_sets(cpuinfo) == ["avx2", "avx512_vnni", "avx512f", "fma", "sse4_2"]
    assert instruction_sets("") == [] and instruction_sets("Features\t: asimd crc32 sve2\n") == ["asimd", "sve2"]
