"""Shards: windows compared with closed forms, dependence on plan and number only, and invalid plans."""

import dataclasses
import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.datasets.folder import MANIFEST, check_folder
from enhsim_tf.datasets.mix import Mix, ScenarioShare
from enhsim_tf.datasets.plan import make_plan, plan_key
from enhsim_tf.datasets.shard import ShardMaker, draw_rows, make_windows, shard_file, shard_schema, systematic
from tests.known_simulators import of_waves
from tests.small_data_set import COARSE, INTERVAL_S, WINDOW, PlainMaker, plain, plan

EVERY_MODE = ("stuck", "drift", "gain_loss", "period_change")  # the modes without random draws
ALL = Mix(0.2, tuple(ScenarioShare(mode, 0.2, (0.2, 0.9), (0.1, 0.7)) for mode in EVERY_MODE))


def table_of(maker, shard):
    record = maker(shard)
    return record, pq.read_table(maker.folder / shard_file(shard)).to_pandas()


def test_each_window_agrees_with_its_labels(tmp_path):
    maker = PlainMaker(plan(200, 100, mix=ALL), tmp_path)
    maker.__class__ = type("Silent", (PlainMaker,), {"simulator": plain(noise_sd=0)})
    times = INTERVAL_S * (np.arange(240)[:, None] + np.arange(WINDOW))  # all phases
    severities = []
    for shard in range(2):
        record, table = table_of(maker, shard)
        rows = draw_rows(maker.plan, shard)[0]
        assert record.rows == len(table) == 100
        asked = np.array(["nominal", *EVERY_MODE])[rows.scenario]
        assert {name: int((asked == name).sum()) for name in set(asked)} == dict.fromkeys(("nominal", *EVERY_MODE), 20)
        nominal = plain(noise_sd=0).complete(
            plain().alignment.draw(rows.start, [None] * 100, None), np.tile([[[0.0, 0.75]]], (100, 1, 1)), None
        )[0]
        for number, row in enumerate(table.itertuples()):
            scenario = None if asked[number] == "nominal" else Degraded(asked[number], rows.severity[number], rows.onset[number])
            candidates = COARSE.simulate(times, scenario)
            assert np.abs(candidates - row.window).max(axis=1).min() < 1e-4  # the tolerance of a simulator without noise
            mask = row.window != nominal[number, :, 0]
            np.testing.assert_array_equal(row.mask, mask)
            if mask.any():
                assert (row.scenario, row.severity) == (asked[number], np.float32(rows.severity[number]))
                assert (row.onset, row.end) == (np.flatnonzero(mask)[0], np.flatnonzero(mask)[-1] + 1) and row.onset >= 6
                severities.append(row.severity)
            else:
                assert (row.scenario, row.severity) == ("nominal", 0) and np.isnan(row.onset) and np.isnan(row.end)
    assert len(set(severities)) == len(severities) > 120  # some stuck mechanisms would have stood still anyway
    assert np.mean(severities) == pytest.approx(0.55, abs=5 * 0.7 / np.sqrt(12 * 120))


def test_windows_have_the_levels_and_the_noise_of_their_simulator():
    levels = np.array([(10.0, 0.75), (20.0, 1.5), (30.0, 2.25)])[:, None]
    nominal = plan(600, 600, mix=Mix())
    windows, _, _ = make_windows(nominal, plain(0, levels=levels), 0)
    at = {}
    for shift, gain in levels[:, 0]:
        inside = np.abs((windows - shift) / gain).max(axis=(1, 2)) <= 1.0001  # the unit of the coarse signal
        at[shift] = inside.sum()
    assert sum(at.values()) == 600 and min(at.values()) > 200 - 5 * np.sqrt(600 * 2 / 9)
    noise = make_windows(nominal, plain(0.3), 0)[0] - make_windows(nominal, plain(0), 0)[0]
    assert np.std(noise) == pytest.approx(0.3, rel=5 / np.sqrt(2 * noise.size))


def test_a_shard_depends_only_on_plan_and_number(tmp_path):
    folders = [tmp_path / name for name in ("forth", "back", "alone")]
    for folder in folders:
        folder.mkdir()
    some = plan(230, 50)
    forth = [PlainMaker(some, folders[0])(shard) for shard in range(5)]
    maker = PlainMaker(some, folders[1])
    assert [maker(shard) for shard in reversed(range(5))][::-1] == forth
    assert PlainMaker(plan(100_000, 50), folders[2])(3) == forth[3], "however many there are"
    assert len({record.sha256 for record in forth}) == 5 and [record.rows for record in forth] == [50, 50, 50, 50, 30]
    for other in (plan(230, 50, seed=4), plan(230, 50, checksum="1" * 64), plan(230, 50, mix=ALL)):
        assert PlainMaker(other, folders[2])(3) != forth[3]


@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.lists(st.integers(0, 20), min_size=1, max_size=8).filter(any), st.integers(1, 200), st.integers(0, 2**32))
def test_each_category_gets_its_share_of_the_rows(weights, num_rows, seed):
    shares = np.array(weights) / np.sum(weights)
    counts = np.bincount(systematic(shares, num_rows, np.random.default_rng(seed)), minlength=len(shares))
    assert counts.sum() == num_rows and (np.abs(counts - shares * num_rows) < 1 + 1e-9).all()
    assert (counts[shares == 0] == 0).all()


def test_rare_categories_and_the_order_are_random():
    drawn = np.stack([systematic([0.999, 0.001], 100, np.random.default_rng(seed)) for seed in range(4_000)])
    assert drawn.sum() == pytest.approx(400, abs=5 * 20)  # expected: a tenth of a window per shard
    halves = np.stack([systematic([0.5, 0.5], 10, np.random.default_rng(seed)) for seed in range(2_000)])
    np.testing.assert_allclose(halves.mean(axis=0), 0.5, atol=5 * 0.5 / np.sqrt(2_000))  # the same at every position


def test_the_content_of_a_shard_file(tmp_path):
    some = plan(100, 100)
    _, table = table_of(PlainMaker(some, tmp_path), 0)
    schema = pq.read_schema(tmp_path / shard_file(0))
    assert list(table) == ["window", "scenario", "severity", "onset", "end", "mask"]
    assert schema.equals(shard_schema(some.settings())) and schema.metadata[b"settings"].decode() == plan_key(some.settings())
    assert np.stack(table["window"]).dtype == np.float32 and np.stack(table["window"]).shape == (100, WINDOW)
    assert [path.name for path in tmp_path.iterdir()] == ["shard-000000.parquet"]


def test_a_worker_with_other_library_versions_is_refused(tmp_path, monkeypatch, refused):
    from enhsim_tf.datasets import plan as plan_module

    maker = ShardMaker(plan(), tmp_path)
    monkeypatch.setattr(plan_module.importlib.metadata, "version", lambda name: "0.0")
    with refused("every machine", "numpy"):
        maker(0)


# plans


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A read-only saved simulator."""
    folder = tmp_path_factory.mktemp("models") / "volts"
    plain().save(folder)
    return folder


def test_a_plan_holds_what_its_model_says_and_no_path(model):
    made = make_plan(Mix(), model, seed=1, num_windows=20_000)
    assert (made.window, made.interval_s, made.name) == (60, 2.0, "volts")
    assert (made.shard, made.num_shards, made.num_windows_in(2)) == (8_192, 3, 20_000 - 2 * 8_192)
    assert str(model) not in json.dumps(made.settings())


def test_the_windows_of_a_shard_are_those_of_the_saved_simulator(model, tmp_path):
    made = make_plan(Mix(shard=40), model, seed=1, num_windows=80)
    maker = ShardMaker(made, tmp_path)
    windows = np.stack(table_of(maker, 1)[1]["window"])
    rows, _, noise = draw_rows(made, 1)
    coarse = COARSE.simulate(INTERVAL_S * (rows.start[:, None] + np.arange(60)))
    np.testing.assert_allclose(windows, coarse + plain().noise.generate(40, noise)[:, :, 0], atol=1e-5)


def test_a_scenario_may_concern_one_channel(tmp_path, refused):
    of_waves([COARSE, COARSE], 60, interval_s=2.0).save(tmp_path / "model")
    share = ScenarioShare("drift", 1.0, (1.0, 1.0), (0.5, 0.5), "amps")
    made = make_plan(Mix(0.0, (share,), shard=8), tmp_path / "model", seed=1, num_windows=8)
    _, table = table_of(ShardMaker(made, tmp_path), 0)
    assert (
        not np.stack(table["mask volts"]).any()
        and np.stack(table["mask amps"])[:, 31:].all()
        and made.settings()["channels"] == ["volts", "amps"]
    )
    with refused("volts, amps", "'watts' in the scenario"):
        make_plan(Mix(0.0, (dataclasses.replace(share, channel="watts"),)), tmp_path / "model", 1, 8)


def test_a_model_replaced_after_planning_is_refused(tmp_path, refused):
    plain().save(tmp_path / "volts")
    maker = ShardMaker(make_plan(Mix(), tmp_path / "volts", 0, 10), tmp_path)
    plain(0.2).save(tmp_path / "volts")
    with refused("at the start of the data set"):
        maker(0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"num_windows": 0}, "windows"),
        ({"num_windows": 10**10 + 1}, "windows"),
        ({"shard": 10**9}, "shards"),
    ],
)
def test_data_sets_with_sizes_out_of_range_are_refused(changes, words, refused):
    with refused(words):
        plan(**changes)


def test_a_data_set_of_another_format_is_refused(tmp_path, refused):
    made = plan(40, 40)
    write_json(tmp_path / MANIFEST, {"format": "enhsim_tf.datasets.generate/3", "settings": made.settings(), "shards": None})
    with refused("generate/4", "generate/3", "another folder"):
        check_folder(tmp_path, made)
