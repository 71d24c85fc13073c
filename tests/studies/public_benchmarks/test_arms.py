"""What the views learn and judge in each use, and the events of `score`."""

import types

import numpy as np

from enhsim_tf.scoring.scorer import Scorer
from studies.public_benchmarks import arms
from studies.public_benchmarks.arms import Simulators, Views, pieces_of, window_of
from studies.public_benchmarks.methods import without
from studies.public_benchmarks.series import SKAB, Series
from studies.public_benchmarks.tool import times_of


def test_pieces_lie_between_what_is_left_out():
    values = np.arange(12.0).reshape(6, 2)
    found = pieces_of(without(values, 2, 4))
    assert {begin: piece.tolist() for begin, piece in found.items()} == {
        0: [[0, 1], [2, 3]],
        4: [[8, 9], [10, 11]],
    }


class FirstLeftOut(Simulators):
    """Simulators whose signal is the first sample that they have not learnt, -1 if there is none."""

    def fitted(self, nominal):
        is_left = np.isnan(nominal[:, 0])
        signal = float(np.argmax(is_left)) if is_left.any() else -1.0
        return types.SimpleNamespace(window=10, signal=signal)


def test_the_difference_is_from_a_simulator_that_has_not_learnt_the_block(monkeypatch):
    monkeypatch.setattr(arms, "unexplained", lambda simulator, windows: windows - simulator.signal)
    values = np.random.default_rng(0).standard_normal((80, 2)).astype(np.float32)
    found = FirstLeftOut(0).difference(Series("A", SKAB, values, values[:25], ((3, 4),)))
    np.testing.assert_allclose(
        values - found.nominal, np.repeat([0, 20, 40, 60], 20)[:, None] + [0, 0], atol=1e-5
    )
    np.testing.assert_allclose(values[:25] - found.judged, -1, atol=1e-5)


def test_views_score_by_their_sum_whatever_the_threshold():
    rng = np.random.default_rng(0)
    nominal, judged = rng.standard_normal((600, 1)), rng.standard_normal((200, 1))
    views = Views().fit(without(nominal, 200, 300))
    found, direct = views.score(judged), Scorer([nominal[:200], nominal[300:]]).score(judged)
    window = window_of(np.concatenate([nominal[:200], nominal[300:]]))
    ends = direct.begins + window - 1
    np.testing.assert_allclose(found.past[ends], direct.by_view.sum(axis=0), rtol=1e-3)
    ratio = found.whole / direct.samples
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-3)


def test_times_are_those_of_the_first_event_that_was_not_detected_before():
    def event(begin, detected):
        return types.SimpleNamespace(begin=begin, detected=detected)

    events = [event(90, 99), event(98, 110), event(104, 112), event(230, 240)]
    # onset two samples early, detected ten late; thirty late, forty late; the third is not found
    assert (times_of(events, ((100, 120), (200, 260), (300, 310)))) == ((2 + 30) / 2, (10 + 40) / 2)
    assert np.isnan(times_of([], ((1, 2),))).all()
