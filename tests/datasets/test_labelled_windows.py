"""Labelled windows: compared with closed forms, dependence on plan and shard only, and invalid
plans.
"""

import collections
import dataclasses
import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.datasets import labelled_windows
from enhsim_tf.datasets.generate import MANIFEST, check_folder
from enhsim_tf.datasets.label_columns import LABELS
from enhsim_tf.datasets.labelled_windows import (
    ShardMaker,
    draw_scenarios,
    make_plan,
    shard_file,
    systematic,
    write_windows,
)
from enhsim_tf.datasets.places import ScenarioRange
from tests.known_simulators import of_waves
from tests.small_data_set import COARSE, INTERVAL_S, WINDOW, PlainMaker, plain, plan

EVERY_MODE = ("stuck", "drift", "gain_loss", "period_change")  # the modes without random draws
ALL = tuple(ScenarioRange(mode, (0.2, 0.9), (0.1, 0.7)) for mode in EVERY_MODE)


def written(path, asked, simulator):
    write_windows(path, asked, simulator)
    return pd.read_parquet(path)


def test_each_window_agrees_with_its_labels(tmp_path):
    asked, silent = plan(200, 100, scenarios=ALL, nominal=0.2), plain(noise_sd=0)
    table = written(tmp_path / "x", asked, silent)
    nominal = written(
        tmp_path / "nominal", dataclasses.replace(asked, scenarios=(), nominal_share=1.0), silent
    )
    assert list(table) == ["window", *LABELS] and len(table) == len(nominal) == 200
    times = INTERVAL_S * (np.arange(240)[:, None] + np.arange(WINDOW))  # all phases
    scenarios, severities = [*draw_scenarios(asked, 0), *draw_scenarios(asked, 1)], []
    assert collections.Counter(each and each.mode for each in scenarios) == dict.fromkeys(
        (None, *EVERY_MODE), 40
    )
    for row, same, scenario in zip(table.itertuples(), nominal["window"], scenarios, strict=True):
        candidates = COARSE.simulate(times, scenario)
        # the tolerance of a simulator without noise
        assert np.abs(candidates - row.window).max(axis=1).min() < 1e-4
        mask = row.window != same
        np.testing.assert_array_equal(row.mask, mask)
        if mask.any():
            assert (row.scenario, row.severity) == (scenario.mode, np.float32(scenario.severity))
            changed = np.flatnonzero(mask)
            assert (row.onset, row.end) == (changed[0], changed[-1] + 1) and row.onset >= 6
            severities.append(row.severity)
        else:  # some stuck mechanisms would have stood still anyway
            assert (row.scenario, row.severity) == ("nominal", 0)
            assert np.isnan(row.onset) and np.isnan(row.end)
    assert len(set(severities)) == len(severities) > 120
    assert np.mean(severities) == pytest.approx(0.55, abs=5 * 0.7 / np.sqrt(12 * 120))


def test_a_shard_depends_only_on_plan_and_number(tmp_path):
    folders = [tmp_path / name for name in ("forth", "back", "alone")]
    for folder in folders:
        folder.mkdir()
    some = plan(230, 50)
    forth = [PlainMaker(some, folders[0])(shard) for shard in range(5)]
    maker = PlainMaker(some, folders[1])
    assert [maker(shard) for shard in reversed(range(5))][::-1] == forth
    assert PlainMaker(plan(100_000, 50), folders[2])(3) == forth[3], "however many there are"
    assert len(set(forth)) == 5 and pq.read_metadata(folders[0] / shard_file(4)).num_rows == 30
    others = {"seed": 4}, {"checksum": "1" * 64}, {"scenarios": ALL}
    for changed in others:
        assert PlainMaker(plan(230, 50, **changed), folders[2])(3) != forth[3]


@settings(max_examples=100, derandomize=True, deadline=None)
@given(
    st.lists(st.integers(0, 20), min_size=1, max_size=8).filter(any),
    st.integers(1, 200),
    st.integers(0, 2**32),
)
def test_each_category_gets_its_share_of_the_rows(weights, num_rows, seed):
    shares = np.array(weights) / np.sum(weights)
    counts = np.bincount(
        systematic(shares, num_rows, np.random.default_rng(seed)), minlength=len(shares)
    )
    assert counts.sum() == num_rows and (np.abs(counts - shares * num_rows) < 1 + 1e-9).all()
    assert (counts[shares == 0] == 0).all()


def test_rare_categories_and_the_order_are_random():
    drawn = np.stack(
        [systematic([0.999, 0.001], 100, np.random.default_rng(seed)) for seed in range(4_000)]
    )
    assert drawn.sum() == pytest.approx(400, abs=5 * 20)  # expected: a tenth of a window per shard
    halves = np.stack(
        [systematic([0.5, 0.5], 10, np.random.default_rng(seed)) for seed in range(2_000)]
    )
    # the same at every position
    np.testing.assert_allclose(halves.mean(axis=0), 0.5, atol=5 * 0.5 / np.sqrt(2_000))


def test_other_programs_can_read_the_file(tmp_path):
    some = plan(100, 100)
    write_windows(tmp_path / "x", some, plain())
    schema = pq.read_schema(tmp_path / "x")
    assert schema.field("window").type.list_size == schema.field("mask").type.list_size == WINDOW
    assert str(schema.field("window").type.value_type) == "float"
    types = [str(schema.field(name).type) for name in LABELS[:4]]
    assert types == ["string", "float", "int32", "int32"]
    assert schema.metadata[b"interval_s"] == b"2.0" and schema.metadata[b"channel"] == b"volts"
    assert schema.metadata[b"settings"].decode() == some.key()
    assert 0 < pq.read_table(tmp_path / "x", filters=[("scenario", "==", "stuck")]).num_rows <= 25
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_a_worker_with_other_library_versions_is_refused(tmp_path, monkeypatch, refused):
    maker = ShardMaker(plan(), tmp_path)
    monkeypatch.setattr(labelled_windows.importlib.metadata, "version", lambda name: "0.0")
    with refused("every machine", "numpy"):
        maker(0)


# plans


def planned(simulator, folder, *scenarios, nominal=0.5, windows=20_000, seed=1):
    simulator.save(folder)
    return make_plan(simulator, folder, scenarios, nominal, windows, seed)


def test_a_plan_holds_what_its_model_says_and_no_path(tmp_path):
    made = planned(plain(), tmp_path / "volts")
    assert (made.window, made.interval_s, made.channels) == (60, 2.0, ("volts",))
    assert made.nominal_share == 1.0
    assert (made.shard, made.num_shards, made.num_windows_in(2)) == (8_000, 3, 4_000)
    assert str(tmp_path) not in json.dumps(made.settings())


def test_a_scenario_may_concern_one_channel(tmp_path, refused):
    both = of_waves([COARSE, COARSE], 60, interval_s=2.0)
    drift = ScenarioRange("drift", (1.0, 1.0), (0.5, 0.5), "amps")
    asked = planned(both, tmp_path / "model", drift, nominal=0.0, windows=8)
    table = written(tmp_path / "x", asked, both)
    assert list(table) == ["window volts", "window amps", *LABELS, "mask volts", "mask amps"]
    assert not np.stack(table["mask volts"]).any() and np.stack(table["mask amps"])[:, 31:].all()
    with refused("volts, amps", "'watts' in the scenario"):
        planned(both, tmp_path / "model", dataclasses.replace(drift, channel="watts"))


def test_a_model_replaced_after_planning_is_refused(tmp_path, refused):
    maker = ShardMaker(planned(plain(), tmp_path / "volts"), tmp_path)
    plain(0.2).save(tmp_path / "volts")
    with refused("at the start of the data set"):
        maker(0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"num_windows": 0}, "windows"),
        ({"num_windows": 10**10 + 1}, "windows"),
        ({"num_windows": 3}, "each of 2 scenarios"),  # one and a half for two of them
    ],
)
def test_data_sets_with_sizes_out_of_range_are_refused(changes, words, refused):
    with refused(words):
        plan(**changes)


def test_each_scenario_has_a_window_in_the_smallest_data_set():
    modes = {scenario and scenario.mode for scenario in draw_scenarios(plan(4), 0)}
    assert modes == {None, "stuck", "gain_loss"}
    assert draw_scenarios(plan(4, nominal=1.0), 0) == [None] * 4


def test_a_data_set_of_another_format_is_refused(tmp_path, refused):
    made = plan(40, 40)
    write_json(
        tmp_path / MANIFEST,
        {"format": "enhsim_tf.datasets.generate/4", "settings": made.settings(), "shards": None},
    )
    with refused("generate/5", "generate/4", "another folder"):
        check_folder(tmp_path, made)
