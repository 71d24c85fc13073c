import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from benchmarks import figures, rows
from benchmarks.__main__ import ROWS, main, parse
from benchmarks.figures import draw
from benchmarks.machine import machine
from benchmarks.report import fill_page, line_of, markdown, with_words
from benchmarks.worker import Worker
from enhsim_tf.common.errors import InputError

ROOT = Path(__file__).parents[2]


def test_ways_take_turns():
    calls = []
    found = rows.in_turns({"a": lambda: calls.append("a") or len(calls), "b": lambda: calls.append("b") or len(calls)}, 3)
    assert "".join(calls) == "baabba"
    assert found == {"a": [2, 3, 6], "b": [1, 4, 5]}


def test_a_row_compares_neighbours():
    row = rows.compared("work", [0.001, 0.002, 0.009], "other", [0.002, 0.002, 0.003], "ms", 0.9)
    assert row["ours"] == {"median": 2.0, "low": 1.0, "high": 9.0}
    assert row["ratio"] == pytest.approx({"median": 1.0, "low": 0.5, "high": 3.0})
    assert row["reached"] is False
    assert rows.compared("work", [1.0], "other", [2.0], "s", 0.5)["reached"] is True
    assert rows.compared("work", [1.0], "other", [2.0], "s", None)["reached"] is None


def measured(work, comparison, ours, theirs):
    return rows.compared(work, [ours / 1e3], comparison, [theirs / 1e3], "ms", 0.7)


def test_the_reproduction_is_put_together_from_steps():
    found = [measured("enhancer step", "plain fit", 20.0, 40.0), measured("GAN iteration", "textbook loop", 50.0, 200.0)]
    (row,) = rows.reproduction(found, bar=0.4)
    assert row["ours"]["median"] == pytest.approx(0.020 * 4_000 + 0.050 * 1_000)
    assert row["ratio"]["median"] == pytest.approx(130 / 360)
    assert row["ratio"]["low"] == pytest.approx(130 / 360)  # one repetition: no range
    assert row["reached"] is True
    assert list(rows.reproduction(found[:1])) == []


def test_the_traffic_and_the_work_of_the_enhancer():
    layers = [(500, 500), (500, 3_200), (3_200, 3_200), (3_200, 500)]
    assert rows.PARAMETERS == sum(inputs * outputs + outputs for inputs, outputs in layers)
    assert rows.WINDOW_FLOP == 2 * sum(inputs * outputs for inputs, outputs in layers)


GROWTH = [
    {"x": "num_windows", "work": "w", "growth": [{"num_windows": n, "seconds": n / 9, "peak_mb": 500 + n} for n in (10, 100)]},
    {"x": "window", "work": "t", "growth": [{"window": n, "enhancer_ms": n / 9, "gan_ms": n**2 / 3, "peak_mb": {}} for n in (125, 250)]},
]


def words(figure):
    return " ".join(text.get_text() for text in figure.findobj(Text))


def test_figures_are_drawn_from_the_results(tmp_path):
    found = {"rows": [measured("enhancer step", "plain fit", 20.0, 40.0), {"work": "a", "comparison": "b", "skipped": "c"}, *GROWTH]}
    files = draw(found, tmp_path)
    assert {file.name for file in files} == {f"speed_{name}.{kind}" for name in ("ratios", "growth") for kind in ("png", "svg")}
    assert all(file.stat().st_size > 5_000 for file in files)
    assert all(line_of(row) for row in found["rows"])
    assert draw({"rows": []}, tmp_path) == []
    drawn = [file.read_bytes() for file in files]
    assert [file.read_bytes() for file in draw(found, tmp_path)] == drawn
    svg = (tmp_path / "speed_ratios.svg").read_text()
    assert "python -m benchmarks" in svg and "SMOKE" not in svg
    draw(found | {"quick": True, "machine": {"cores": 3, "tensorflow": "1.2"}}, tmp_path)
    svg = (tmp_path / "speed_ratios.svg").read_text()
    assert "SMOKE" in svg and "3 cores, TensorFlow 1.2" in svg


def test_the_titles_say_what_the_numbers_say():
    fast, slow = measured("step", "plain fit", 20.0, 40.0), measured("iteration", "a loop", 90.0, 100.0)
    said = words(figures.FIGURES["speed_ratios"].draw({"rows": [fast, slow, fast]}))
    assert "2 of these 3 bars are reached; not reached: iteration" in said and "against a loop" in said
    assert "0.50 ≤ 0.70" in said and "0.90 > 0.70" in said
    assert "All of these 2 bars are reached Time" in words(figures.FIGURES["speed_ratios"].draw({"rows": [fast, fast]}))
    said = words(figures.FIGURES["speed_growth"].draw({"growth": {row["x"]: row["growth"] for row in GROWTH}}))
    assert "10 times as many windows take 10 times as long and 1.18 times the memory" in said  # 600 / 510
    assert "Windows 2 times as long take 2.0 times the time for a step of the enhancer, 4.0 times for" in said.replace("\n", " ")


def test_numbers_stand_on_no_line():
    rows_of = [measured("step", "plain fit", ratio, 1.0) for ratio in (0.69, 0.7, 1.0, 1.02)]
    figure = figures.FIGURES["speed_ratios"].draw({"rows": rows_of})
    (axes,) = figure.axes
    FigureCanvasAgg(figure).draw()
    inside, width = axes.get_window_extent(), figure.bbox.width
    places = [text.get_window_extent() for text in axes.texts]
    assert len(places) == 4 and all(inside.x1 < place.x0 and place.x1 < width for place in places)
    ends = {text.get_text()[:4]: (place.y0 + place.y1) / 2 for text, place in zip(axes.texts, places, strict=True)}
    for number, row in enumerate(reversed(rows_of)):
        assert ends[f"{row['ratio']['median']:.2f}"] == pytest.approx(axes.transData.transform((1, number))[1], abs=3)


def test_redraw_measures_nothing_and_changes_no_number(tmp_path, monkeypatch):
    monkeypatch.setattr(rows, "ROWS", {})  # nothing there that could measure
    steps = [measured("enhancer step", "plain fit", 20.0, 40.0), measured("GAN iteration", "textbook loop", 50.0, 200.0)]
    (composed,) = rows.reproduction(steps)
    kept = [{"of": "enhancer", **steps[0]}, {"of": "gan", **steps[1]}, {"of": "reproduction", **composed, "work": "old words"}]
    out = tmp_path / "results.json"
    out.write_text(json.dumps({"quick": False, "minutes": 9.6, "machine": {"cores": 2, "tensorflow": "1.0"}, "rows": kept}))
    before = json.loads(out.read_text())
    assert main(["--redraw", "--out", str(out), "--figures", str(tmp_path / "new")]) == 0
    before["rows"][2] |= {"work": composed["work"], "bar": 0.18, "reached": composed["ratio"]["median"] <= 0.18}  # no AVX-512 is named
    assert json.loads(out.read_text()) == before and "composed from the steps above" in composed["work"]
    assert (tmp_path / "new" / "speed_ratios.png").is_file()
    assert "composed from the steps above" in line_of(composed) and "composed from the steps above" in markdown([before])


@pytest.mark.parametrize(("arguments", "word"), [(["--only", "gan"], "measures nothing"), ([], "needs the results")])
def test_redraw_refuses_what_it_cannot_do(tmp_path, capsys, arguments, word):
    with pytest.raises(SystemExit) as left:
        parse(["--redraw", "--out", str(tmp_path / "none.json"), *arguments])
    assert left.value.code == 2 and word in capsys.readouterr().err


def test_the_kept_results_and_the_page_say_the_same():
    kept = [json.loads((ROOT / "benchmarks" / name).read_text()) for name in ("results.json", "results_avx2.json")]
    for each in kept:
        assert with_words(each) == each["rows"]
    assert f"<!-- speed: generated -->\n{markdown(kept)}\n<!-- end of speed -->" in (ROOT / "docs" / "speed.md").read_text(encoding="utf-8")


def test_a_worker_says_why_it_is_skipped(monkeypatch, tmp_path):
    (tmp_path / "torch.py").write_text("raise ImportError('no torch here')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    worker = Worker("torch_enhancer", "enhancer_step", num_steps=1)
    assert worker.skipped == "no torch here"


def test_quick_needs_a_place_of_its_own(capsys):
    with pytest.raises(SystemExit):
        parse(["--quick"])
    assert "results.json holds measurements" in capsys.readouterr().err


def test_help_needs_no_tensorflow():
    program = "import sys, benchmarks.__main__\nassert 'tensorflow' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[2])


def test_a_quick_run_measures_and_keeps_other_rows(tmp_path, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    out = tmp_path / "results.json"
    kept = {"of": "gan", "work": "GAN iteration", "comparison": "x", "skipped": "y", "unit": "ms"}
    elsewhere = {"processor": "another processor", "cores": 64, "tensorflow": "2.21.0"}
    out.write_text(json.dumps({"machine": elsewhere, "rows": [kept]}))
    assert main(["--quick", "--only", "loading", "--out", str(out), "--figures", str(tmp_path)]) == 0
    found = json.loads(out.read_text())
    assert found["quick"] is True and kept in found["rows"]
    (loading,) = [row for row in found["rows"] if row["of"] == "loading"]
    assert loading["ratio"]["low"] <= loading["ratio"]["median"] <= loading["ratio"]["high"]
    assert np.isfinite(loading["ours"]["median"]) and loading["peak_mb"] > 100
    assert {row["of"] for row in found["rows"]} <= set(ROWS)
    assert found["machine"] == elsewhere and loading["machine"]["processor"] == machine()["processor"]
    text = markdown([found])
    assert "| loading a simulator * |" in text and "| GAN iteration |" in text and text.count("another processor: ") == 1


def test_the_page_gets_the_table_between_its_markers(tmp_path):
    slow = measured("enhancer step", "plain fit", 90.0, 100.0)
    found = {"rows": [slow, {"work": "a", "comparison": "b", "skipped": "no c"}], "machine": {"cores": 2, "tensorflow": "1.0"}}
    path = tmp_path / "docs" / "speed.md"
    path.parent.mkdir()
    path.write_text("before\n<!-- speed: generated -->\nold\n<!-- end of speed -->\nafter\n")
    fill_page(tmp_path, [found])
    text = path.read_text()
    assert text == f"before\n<!-- speed: generated -->\n{markdown([found])}\n<!-- end of speed -->\nafter\n"
    assert "| enhancer step | 90 ms | plain fit | 0.90 (0.90 to 0.90) | at most 0.70 | **not reached** |  |" in text and "no c" in text
    path.write_text("<!-- timings: generated -->")
    with pytest.raises(InputError, match="markers of 'speed' once in speed.md"):
        fill_page(tmp_path, [found])
    assert path.read_text() == "<!-- timings: generated -->"


CPUINFO = "processor\t: 0\nmodel name\t: Some Processor\nflags\t\t: fpu sse4_2 avx2 fma avx512f avx512_vnni hypervisor\nprocessor\t: 1\n"


def test_the_machine_is_named_with_its_instruction_sets():
    from benchmarks.machine import has_avx512, instruction_sets, machine

    assert instruction_sets(CPUINFO) == ["avx2", "avx512_vnni", "avx512f", "fma", "sse4_2"]
    assert instruction_sets("") == [] and instruction_sets("Features\t: asimd crc32 sve2\n") == ["asimd", "sve2"]
    assert has_avx512({"instruction_sets": ["avx512f"]}) and not has_avx512({"instruction_sets": ["avx2"]}) and not has_avx512({})
    assert machine()["cores"] >= 1 and machine()["tensorflow"]


@pytest.mark.parametrize(("about", "bar"), [({"instruction_sets": ["avx512f"]}, 0.33), ({"instruction_sets": ["avx2"]}, 0.18)])
def test_more_is_asked_where_plain_keras_computes_with_plain_kernels(about, bar):
    assert rows.bar_of_reproduction(about) == bar
    assert rows.bar_of_reproduction(about | {"as_without_avx512": True}) == 0.18


def test_a_worker_counts_page_faults_and_runs_in_its_environment(monkeypatch, tmp_path):
    """Each repetition of this work writes a megabyte of new memory: 256 pages, a few more for the count itself."""
    (tmp_path / "faulty.py").write_text(
        "import mmap, os\n"
        "def touch(pages):\n"
        "    if os.environ.get('ENHSIM_TF_TRIED') != 'yes':\n"
        "        raise ImportError(os.environ.get('ENHSIM_TF_TRIED', 'not set'))\n"
        "    kept = []\n"
        "    def run():\n"
        "        kept.append(mmap.mmap(-1, pages * mmap.PAGESIZE))\n"
        "        kept[-1].madvise(mmap.MADV_NOHUGEPAGE)\n"
        "        kept[-1].write(bytes(pages * mmap.PAGESIZE))\n"
        "    return run, pages\n"
    )
    import benchmarks

    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{ROOT}")
    monkeypatch.setattr(Worker, "processor", {"ENHSIM_TF_TRIED": "yes"})
    script = (
        f"import benchmarks, sys\nbenchmarks.__path__.append({str(tmp_path)!r})\nfrom benchmarks.worker import main\nmain(*sys.argv[1:])"
    )
    monkeypatch.setattr(benchmarks.worker, "COMMAND", [sys.executable, "-c", script])
    worker = Worker("faulty", "touch", pages=256)
    assert worker.skipped is None
    for _ in range(3):
        worker.repeat()
    worker.close()
    assert all(0.9 < faults < 4 for faults in worker.faults) and len(worker.faults) == 3
    monkeypatch.setattr(Worker, "of_comparisons", {"ENHSIM_TF_TRIED": "no"})
    assert Worker("faulty", "touch", pages=1).skipped == "no"


def test_the_row_of_a_whole_run_counts_its_faults():
    (row,) = rows.reproduce(rows.QUICK)
    assert row["faults"] > 10_000 and row["seconds"] > 1 and row["user_s"] > 1
    assert row["reached"] == (row["faults"] <= 2_000_000)
    assert f"{row['faults']:,} faults" in line_of(row)
    assert f"| {row['faults']:,} |" in markdown([{"rows": [row], "machine": {"cores": 2, "tensorflow": "1.0"}}])
