import numpy as np
import pytest

from enhsim_tf.paper import noise
from enhsim_tf.paper.claims import CLAIMS, NOT_MEASURED, judge_all, outside
from enhsim_tf.paper.noise import NoiseGAN
from enhsim_tf.paper.square_wave import simulator
from tests.paper.conftest import TINY, tiny_pipeline


@pytest.fixture(scope="module")
def records(pipeline):
    return judge_all(pipeline)


def test_windows_of_simulation_telemetry_and_truth_are_of_the_same_times(pipeline):
    found = pipeline.windows("test", 4, "a purpose")
    time = pipeline.parts["test"].time[found["start"][:, None] + np.arange(TINY["window"])]
    np.testing.assert_allclose(found["coarse"], simulator(pipeline.settings)(time), atol=1e-6)
    np.testing.assert_allclose(found["truth"], pipeline.truth(time), atol=1e-6)
    assert np.std(found["target"] - found["truth"]) == pytest.approx(0.1, rel=0.2)


def test_without_an_average_the_noise_is_what_was_added_to_the_signal(pipeline, cache):
    white = tiny_pipeline(cache, average="none")
    noise, part = white.noise_series("train"), white.parts["train"]
    np.testing.assert_allclose(noise + white.truth(part.time), part.values, atol=1e-6)
    assert np.std(noise) == pytest.approx(0.1, rel=0.03)
    # the average takes away what it holds of the noise
    assert np.var(pipeline.noise_series("train")) == pytest.approx(0.96 * 0.01, rel=0.05)


@pytest.fixture(scope="module")
def afresh(tmp_path_factory):
    """A second run with an empty cache, the cache, and the real rows of its GAN by batches."""
    folder, batches, rows = tmp_path_factory.mktemp("afresh"), [], noise.Rows.__getitem__
    fresh = tiny_pipeline(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            noise.Rows, "__getitem__", lambda *at: batches.append(rows(*at)) or batches[-1]
        )
        _ = fresh.gan_folder
    return fresh, folder, batches


def test_every_update_gets_rows_drawn_anew_from_the_whole_train_part(afresh):
    fresh, _, batches = afresh
    drawn = np.concatenate(batches)
    assert len(np.unique(drawn[:, 0])) > 0.9 * len(drawn)
    assert set(drawn[:, 0]) <= set(fresh.noise_series("train"))


def test_the_whole_paper_runs_and_every_claim_is_judged(records):
    assert [record["id"] for record in records] == [f"C{number}" for number in range(1, 10)]
    assert all(record["verdict"] != NOT_MEASURED and record["deciding"] for record in records)
    assert all(np.isfinite(list(record["measured"].values())).all() for record in records)


def test_the_sum_is_the_enhanced_signal_plus_generated_noise(pipeline):
    coarse = pipeline.windows("test", 3, "sum")["coarse"]
    noise = pipeline.generate_noise(3, np.random.default_rng(5))
    np.testing.assert_array_equal(
        pipeline.combine(coarse, np.random.default_rng(5)), pipeline.enhance(coarse) + noise
    )


def test_a_second_run_takes_every_stage_from_the_cache_and_finds_the_same(records, cache):
    again = tiny_pipeline(cache)
    assert judge_all(again) == records
    assert all(again.stages.cached.values())


def test_a_run_from_nothing_finds_the_same_and_another_reading_trains_only_what_it_touches(
    pipeline, cache, afresh
):
    fresh, folder, _ = afresh
    np.testing.assert_array_equal(fresh.history["sd"], pipeline.history["sd"])
    other = tiny_pipeline(folder, latent_scale=1)
    assert other.history["sd"][0] != fresh.history["sd"][0]
    assert (other.stages.cached["telemetry"], other.stages.cached["noise GAN"]) == (True, False)
    other = tiny_pipeline(cache, latent_scale=1)
    assert other.enhancer_folder == pipeline.enhancer_folder


def test_a_training_that_learnt_nothing_is_named(records, cache, tmp_path, monkeypatch):
    ranges = {
        record["id"]: {
            "ranges": {name: [value, value] for name, value in record["measured"].items()}
        }
        for record in records
    }
    assert outside(records, {"claims": ranges}) == []
    monkeypatch.setattr(NoiseGAN, "train_discriminator", lambda gan, rows, tags: None)
    broken = tiny_pipeline(tmp_path)
    (balance,) = (claim for claim in CLAIMS if claim.id == "C5")
    named = outside([{"id": "C5", "measured": balance.measure(broken)}], {"claims": ranges})
    assert any(line.startswith("C5: late_") for line in named)
