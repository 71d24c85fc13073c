import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.scoring.scorer import Scorer


class Largest:
    """A view whose scores are easily computed: the largest size of a sample."""

    def fit(self, windows):
        self.number = len(windows)
        return self

    def score(self, windows):
        return np.abs(windows).max(axis=(1, 2))


class Learnt:
    """A view that is 1 for a window that holds a sample which it has learnt, otherwise 0."""

    def fit(self, windows):
        self.seen = np.unique(windows)
        return self

    def score(self, windows):
        return np.isin(windows, self.seen).any(axis=(1, 2)).astype(float)


def noise(number, channels=1, seed=0):
    return np.random.default_rng(seed).standard_normal((number, channels)).astype(np.float32)


def by_hand(series, window):
    """The mean of the largest sizes in all windows that hold a sample; one begins every eighth of a
    window, and one ends the series. At both ends the mean is that of the first and last sample with
    all windows.
    """
    step = window // 8
    begins = [*range(0, len(series) - window, step), len(series) - window]
    sums, counts = np.zeros(len(series)), np.zeros(len(series))
    for begin in begins:
        sums[begin : begin + window] += np.abs(series[begin : begin + window]).max()
        counts[begin : begin + window] += 1
    means = sums / counts
    means[: window - 1], means[len(series) - window + 1 :] = means[window - 1], means[-window]
    return means


@pytest.mark.parametrize(("number", "window"), [(256, 16), (1_000, 40), (1_600, 64), (9_000, 64)])
def test_windows_have_64_samples_or_a_twenty_fifth_of_a_short_record(number, window):
    assert Scorer([noise(number)]).window == window


def test_a_sample_has_the_mean_score_of_the_windows_that_hold_it_in_units_of_the_threshold():
    nominal, new = noise(6_400), noise(300, seed=1)
    scorer = Scorer([nominal], 0.05, {"largest": Largest})
    centre, scale = np.median(nominal), nominal.std()
    nominal_windows = np.abs((nominal - centre) / scale)[:, 0]
    unit = np.quantile(
        [nominal_windows[begin : begin + 64].max() for begin in range(0, 6_337, 8)], 0.99
    )
    scores = by_hand((nominal[:, 0] - centre) / scale, 64) / unit
    # the conformal rank, of the last quarter if that is higher
    ranks = [
        np.sort(some)[int(np.ceil((len(some) + 1) * 0.95)) - 1] for some in (scores, scores[4_800:])
    ]
    assert scorer.threshold == pytest.approx(1.001 * max(1.0, *ranks), rel=1e-5)
    assert scorer.rate == 0.05
    expected = by_hand((new[:, 0] - centre) / scale, 64) / unit / scorer.threshold
    np.testing.assert_allclose(scorer.score(new).samples, expected, rtol=1e-5)


def test_with_few_windows_the_largest_nominal_score_is_the_threshold():
    scorer = Scorer([noise(1_600)])  # 25 windows, for a rate of a hundredth
    assert scorer.nominal_scores.max() == pytest.approx(1 / 1.001)
    assert scorer.rate == pytest.approx(1 / 26)


def test_nominal_scores_are_of_views_that_have_not_learnt_their_block():
    scorer = Scorer([noise(3_000), noise(2_000, seed=1)], views={"learnt": Learnt})
    assert not scorer.nominal_scores.any()
    assert scorer.score(noise(3_000)).samples.min() > 0


def test_no_more_nominal_samples_than_asked_for_are_flagged():
    """Of twelve series, in each of which 1 % may be flagged on average over their nominal records."""
    shares = [
        np.mean(Scorer([noise(6_400, 2, seed)]).score(noise(6_400, 2, 100 + seed)).samples > 1)
        for seed in range(12)
    ]
    assert 0.001 < np.mean(shares) < 0.01 + 3 * np.std(shares) / np.sqrt(12)


@pytest.mark.parametrize("level", [0.0, 273.15, -1e6])
def test_of_a_channel_that_never_varied_anything_else_is_an_anomaly(level):
    nominal = np.full((2_000, 1), level, np.float32)
    scorer, new = Scorer([nominal]), nominal[:600].copy()
    assert not scorer.score(new).samples.any()
    new[300:310] += 1e-5 * (abs(level) or 1.0)
    found = scorer.score(new).samples > 1
    assert found[300:310].all() and not found[:236].any() and not found[374:].any()


def test_the_score_that_has_seen_only_the_past_does_not_change_with_the_future():
    scorer, series = Scorer([noise(3_000)]), noise(400, seed=2)
    other = series.copy()
    other[200:] += 5
    first, second = scorer.window_scores(series), scorer.window_scores(other)
    np.testing.assert_allclose(first[:200], second[:200], rtol=1e-4)
    assert second[263] > 1 > first[263]


def test_the_channel_that_changed_has_the_largest_share():
    mixed = noise(4_000, 3) @ np.array([[1, 0.9, 0.8], [0, 0.4, 0], [0, 0, 0.6]], np.float32)
    scorer, window = Scorer([mixed]), mixed[100:164].copy()
    window[:, 1] += 4
    shares = scorer.shares(window)
    assert np.argmax(shares) == 1 and shares[1] > 2 * np.delete(shares, 1).max()


def test_too_little_nominal_telemetry_is_refused():
    with pytest.raises(InputError, match="at least 128 samples"):
        Scorer([noise(100), noise(15)])


def test_what_follows_an_extreme_value_is_scored_as_without_it():
    scorer, new = Scorer([noise(6_400)]), noise(1_000, seed=1)
    spoilt = new.copy()
    spoilt[200] = 1e9
    expected = scorer.score(new).samples[400:]
    np.testing.assert_allclose(scorer.score(spoilt).samples[400:], expected, rtol=1e-9)


@pytest.mark.parametrize("length", [64, 96, 128, 400])
def test_false_alarms_of_short_series_are_those_of_the_rate(length):
    scorer = Scorer([noise(6_400)])
    rng = np.random.default_rng(1)
    series = [rng.standard_normal((length, 1)) for _ in range(400)]
    assert np.mean([scorer.score(each).samples > 1 for each in series]) < 0.03


def test_windows_are_shorter_where_all_parts_are():
    scorer = Scorer([noise(60, seed=seed) for seed in range(100)])
    assert scorer.window == 60 and scorer.nominal_edges[-1] == 6_000
