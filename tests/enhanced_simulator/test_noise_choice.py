"""The rule by which a noise model is chosen, with noise whose properties are known."""

import numpy as np
import pytest

from enhsim_tf.common.window_features import signal_edges
from enhsim_tf.detection.evaluation import make_trial
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhanced_simulator.noise_choice import CandidateJudgement, NoiseJudge, choose, features_of, unit_of


def test_the_simplest_candidate_that_passes_is_chosen_and_else_the_nearest():
    def judged(name, auc, alarms, recall=0.6):
        return CandidateJudgement(name, auc, 0.5, alarms, 0.01, recall, 0.6)

    assert choose([judged("none", 1.0, 1.0), judged("Gaussian", 0.54, 0.019), judged("autoregression", 0.5, 0.01)]) == "Gaussian"
    assert choose([judged("none", 1.0, 1.0), judged("Gaussian", 0.7, 0.2), judged("autoregression", 0.6, 0.05)]) == "autoregression"
    assert judged("x", 0.4, 0.01).passes  # an AUC below chance is not better than chance
    assert not judged("x", 0.5, 0.021).passes and not judged("x", 0.56, 0.01).passes
    # detectors that are silent because their thresholds are too high
    assert judged("x", 0.5, 0.0, 0.58).passes and not judged("x", 0.5, 0.0, 0.56).passes
    assert judged("x", 0.6, 0.0, 0.5).departure == pytest.approx(0.2)  # an AUC of 0.1 too much, ten points of recall; no false alarms
    assert choose([judged("loud", 0.6, 0.01, 0.4), judged("right", 0.6, 0.03, 0.6)]) == "right"


def judge_of(learnt, held_out):
    """A judge of noise without a signal, and what its classifier sees of noise."""
    silence = np.zeros_like(learnt)
    edges, unit = signal_edges(silence), unit_of(learnt)

    def seen(noise):
        return features_of(noise, silence, edges, unit)

    return NoiseJudge(learnt, held_out, [silence] * 3, [seen(learnt), seen(held_out)]), seen


def test_noise_of_the_right_scale_passes_and_noise_of_half_the_scale_or_with_loud_windows_does_not():
    rng = np.random.default_rng(5)
    learnt, held_out, generated, quiet = (rng.normal(0, scale, (600, 60)) for scale in (1, 1, 1, 0.5))
    judge, seen = judge_of(learnt, held_out)
    assert judge.judge("right", generated, seen(generated)).passes
    wrong = judge.judge("wrong", quiet, seen(quiet))
    assert wrong.auc > 0.95 and wrong.alarms > 0.5 and not wrong.passes
    # a few loud windows: thresholds are so high that there are no false alarms but also no finds; the recall alone tells
    loud = np.where(np.arange(600) % 30 == 0, 4.0, 1.0)[:, None] * generated
    silent = judge.judge("silent", loud, seen(generated))
    assert silent.alarms <= judge.real_alarms and silent.recall < judge.real_recall - 0.1 and not silent.passes


def test_the_recall_of_a_judgement_is_that_of_the_anomalies_of_the_held_out_windows():
    rng = np.random.default_rng(6)
    learnt, held_out = rng.standard_normal((2, 400, 60))
    judge, seen = judge_of(learnt, held_out)
    found = []
    for detector in (DETECTORS["PCA residual"](0).fit(learnt[:200]), DETECTORS["isolation forest"](0).fit(learnt[:200])):
        threshold = np.sort(detector.score(learnt[200:]))[-2]  # 1 % of 200 windows, without interpolation
        trial = make_trial(held_out, held_out, None, float(learnt.std()), 0, 60)
        found += [np.mean(detector.score(windows) > threshold) for windows in trial.anomalous.values()]
    assert judge.real_recall == pytest.approx(np.mean(found), abs=0.02) and 0.05 < judge.real_recall < 0.95


def test_detectors_are_not_silent_where_few_windows_set_their_thresholds():
    rng = np.random.default_rng(5)
    learnt, held_out, quiet = (rng.normal(0, scale, (60, 60)) for scale in (1, 1, 0.5))
    judge, seen = judge_of(learnt, held_out)  # 30 windows for a rate of 1 %
    assert judge.real_alarms < 0.15 and judge.judge("quiet", quiet, seen(quiet)).alarms > 0.5
