"""The page on sizing agrees with the measurements, and the projection agrees with a calculation by hand."""

import json
from pathlib import Path

import pytest

from benchmarks import sizing
from benchmarks.fleet import PARTS

ROOT = Path(__file__).parents[2]
KEPT = json.loads((ROOT / "benchmarks" / "fleet.json").read_text(encoding="utf-8"))


def row(rate, shard=100, **changed):
    kept = {"windows": 1_000, "samples": 10, "shard": shard, "windows_a_second": rate, "windows_a_second_once_running": 2 * rate}
    memory = {"driver_bytes": 2**29, "largest_worker_bytes": 2**30}
    return kept | memory | {"first_shard_s": 3.0, "bytes_a_window": 36.0} | changed


FOUND = {
    "machine": {"cores": 2, "tensorflow": "2.0"},
    "same_bytes": True,
    "rows": {sizing.ONE: [row(60), row(50)], sizing.TWO: [row(90), row(100)], sizing.RAY: [row(60), row(80)]},
    "large": {sizing.TWO: row(100), sizing.RAY: row(79)},
    "driver": {"local": {"shards_a_second": 950.0}},
    PARTS: {
        "windows": 500,
        "seconds_a_window": {"enhancer": 0.003, "noise": 0.001},
        "enhancer_parameters": 2_000_000,
        "enhancer_flop_a_second": 5e9,
        "matrix_product_flop_a_second": 8e9,
    },
}


def test_a_projection_by_hand():
    # two workers: 190 windows a second once running (median of 180 and 200), so 95 a core, 950 on ten cores
    on = sizing.projected(FOUND, cores=10, num_windows=9_500_000)
    assert on["hours"] == pytest.approx(9_500_000 / 950 / 3_600) and on["core_hours"] == pytest.approx(10 * on["hours"])
    assert on["windows_a_second"] == 950 and on["shards_a_second"] == 9.5
    assert on["mb_a_second"] == pytest.approx(950 * 36 / 1e6) and on["terabytes"] == pytest.approx(9.5e6 * 36 / 1e12)


def test_bars_are_judged_by_the_median_of_neighbours_and_by_the_large_data_set():
    reached = {bar: (value, is_reached) for bar, value, is_reached in sizing.bars(FOUND)}
    assert reached["two workers against one, at least 1.6 times the rate"] == ("1.75 (1.50 to 2.00)", True)
    assert reached["Ray against local, 1,000 windows, at least 0.8 times the rate"] == ("0.79; with 1,000: 0.73 (0.67 to 0.80)", False)
    assert reached["memory of the driver, 1,000 windows, below 1 GiB"] == ("0.50 GiB", True)
    assert reached["memory of the largest worker, 1,000 windows, below 1.5 GiB"] == ("1.00 GiB", True)
    assert list(reached.values())[-1] == ("yes", True)
    assert not list(sizing.bars(FOUND | {"same_bytes": False}))[-1][2]


def test_shares_add_up_and_a_driver_feeds_what_it_hands_out():
    assert "| enhancer | 3.000 | 75% |" in sizing.parts_table(FOUND) and "| noise | 1.000 | 25% |" in sizing.parts_table(FOUND)
    # a core makes 0.95 shards a second, and the driver hands out 950
    assert "keep about this many cores at work, by what it hands out and gets back: local 1,000;" in sizing.projection_table(FOUND)


def test_the_page_says_what_was_measured():
    page = (ROOT / "docs" / "sizing.md").read_text(encoding="utf-8")
    for name, part in sizing.tables(KEPT).items():
        assert f"<!-- {name}: generated -->\n{part}\n<!-- end of {name} -->" in page


def test_the_page_and_the_figure_are_made_from_any_results(tmp_path):
    (tmp_path / "found.json").write_text(json.dumps(FOUND))
    (tmp_path / "page.md").write_text((ROOT / "docs" / "sizing.md").read_text(encoding="utf-8"))
    given = {"--results": "found.json", "--page": "page.md", "--figures": "."}
    assert sizing.main([part for name, path in given.items() for part in (name, str(tmp_path / path))]) == 0
    assert "| noise | 1.000 | 25% |" in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.glob("fleet_sizing.*")} == {"fleet_sizing.png", "fleet_sizing.svg"}
