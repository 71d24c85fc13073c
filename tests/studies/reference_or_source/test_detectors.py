import numpy as np
import pytest

from studies.reference_or_source.detectors import Size, across_folds, classifier, tail_threshold


def test_the_size_is_that_of_the_channel_that_is_largest_in_units_of_its_nominal_one():
    nominal = np.stack([np.tile([1.0, -1.0], 50), np.tile([3.0, -3.0], 50)], axis=1)[None]
    tested = np.stack([np.full(100, 2.0), np.full(100, 3.0)], axis=1)[None]
    assert Size().fit(nominal).score(tested) == pytest.approx([2.0])


def test_known_windows_are_scored_by_detectors_that_have_not_learnt_from_their_fold():
    class Memory:
        def fit(self, windows):
            self.known = set(windows[:, 0, 0])
            return self

        def score(self, windows):
            return np.array([float(each in self.known) for each in windows[:, 0, 0]])

    windows = np.arange(12.0)[:, None, None]
    fitted, scores = across_folds(lambda seed: Memory(), windows, np.arange(12) % 3, 0)
    assert not scores.any()
    assert fitted.score(windows).all()


def test_the_tail_threshold_of_exponential_scores_is_their_quantile():
    scores = np.random.default_rng(0).exponential(size=20_000)
    assert tail_threshold(scores, 0.01) == pytest.approx(-np.log(0.01), rel=0.03)


@pytest.mark.parametrize("name", ["logistic regression", "boosted trees"])
def test_a_classifier_scores_shifted_windows_higher(name):
    rng = np.random.default_rng(0)
    nominal, faulty = (
        rng.standard_normal((200, 20, 2)),
        rng.standard_normal((200, 20, 2)) + [1.0, 0.0],
    )
    score = classifier(name, nominal[:100], faulty[:100], 0)
    assert np.mean(score(faulty[100:]) > np.median(score(nominal[100:]))) > 0.9
