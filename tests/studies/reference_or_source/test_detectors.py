import numpy as np

from studies.reference_or_source.detectors import SumOfViews, across_folds


def test_known_windows_are_scored_by_detectors_that_have_not_learnt_from_their_fold():
    class Memory:
        def fit(self, windows):
            self.known = set(windows[:, 0, 0])
            return self

        def score(self, windows):
            return np.array([float(each in self.known) for each in windows[:, 0, 0]])

    windows = np.arange(12.0)[:, None, None]

    def learn(rows):
        return Memory().fit(windows if rows is None else windows[rows])

    fitted, scores = across_folds(learn, windows, np.arange(12) % 3)
    assert not scores.any()
    assert fitted.score(windows).all()


def test_a_window_with_a_shift_has_a_larger_sum_of_views_than_nominal_ones():
    rng = np.random.default_rng(0)
    nominal, tested = rng.standard_normal((2, 80, 32, 2))
    tested[:10, :, 0] += 3.0
    scores = SumOfViews().fit(nominal).score(tested)
    assert scores[:10].min() > scores[10:].max()
