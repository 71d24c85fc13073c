"""The volume under a surface and the recall at the real rate, compared with small cases by hand, closed forms and a direct implementation of VUS-PR."""

import math

import numpy as np
import pytest

from studies.common.metrics import recall_at_real_rate, vus_pr


def test_recall_at_the_real_rate_by_hand():
    assert recall_at_real_rate(np.arange(99), [97.5, 98, 98.5, 200], rate=0.01) == 0.5  # the threshold is 98
    assert recall_at_real_rate(np.arange(199), [197.5, 196.5]) == 0.5  # by default 1 %: the threshold is 197


def ranges_of(labels):
    """First and last sample of each anomalous range."""
    ranges = []
    for place, label in enumerate(labels):
        if label and (place == 0 or not labels[place - 1]):
            ranges.append([place, place])
        elif label:
            ranges[-1][1] = place
    return ranges


def volume_by_the_definition(labels, scores, max_buffer):
    """Threshold after threshold, buffer after buffer, sample after sample."""
    ranges, areas = ranges_of(labels), []
    for length in range(max_buffer + 1):
        soft = [0.0] * len(labels)
        for begin, end in ranges:
            for place in range(len(labels)):
                distance = max(begin - place, place - end, 0)
                if distance == 0 or distance <= length / 2:
                    soft[place] = max(soft[place], 1.0 if distance == 0 else math.sqrt(1 - distance / length))
        area, before = 0.0, 0.0
        for level in sorted(set(scores), reverse=True):
            alarms = [place for place, score in enumerate(scores) if score >= level]
            found = sum(soft[place] for place in alarms)
            expected = sum(labels) + sum(soft[place] for place in alarms if not labels[place]) / 2
            seen = sum(any(begin - length // 2 <= place <= end + length // 2 for place in alarms) for begin, end in ranges)
            reached = min(1, found / expected) * seen / len(ranges)
            area += (reached - before) * found / len(alarms)
            before = reached
        areas.append(area)
    return sum(areas) / len(areas)


def labels_of(samples, *ranges):
    labels = np.zeros(samples, bool)
    for begin, end in ranges:
        labels[begin:end] = True
    return labels


def test_volume_of_one_range_by_hand():
    labels, scores = [0, 1, 1, 0, 0], [0.1, 0.9, 0.2, 0.8, 0.3]
    w = math.sqrt(1 / 2)  # a buffer of 2 has one sample on either side
    first, second = 0.5, (1 + w) / (2 + w / 2)
    buffered = first * 1 + (second - first) * (1 + w) / 2 + (1 - second) * (2 + w) / 4
    assert vus_pr(labels, scores, 0) == vus_pr(labels, scores, 1) == 0.5 * 1 + 0.5 * 2 / 4
    assert vus_pr(labels, scores, 2) == pytest.approx((0.75 + 0.75 + buffered) / 3)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "ranges",
    [[(20, 30)], [(0, 4), (56, 60)], [(10, 12), (14, 20), (40, 41)], [(0, 60)], [(5, 6), (30, 31)]],
    ids=["inside", "edges", "overlapping buffers", "all", "points"],
)
def test_volume_is_that_of_the_definition(ranges, seed):
    rng, labels = np.random.default_rng(seed), labels_of(60, *ranges)
    scores = rng.random(60) + 0.5 * labels if seed % 2 else rng.integers(0, 7, 60)  # without and with ties
    for max_buffer in (0, 5, 16):
        assert vus_pr(labels, scores, max_buffer) == pytest.approx(volume_by_the_definition(labels, scores.tolist(), max_buffer), abs=1e-12)


TRACE = labels_of(10_000, (2_450, 2_550), (7_450, 7_550))  # 2 % in two ranges of 100 samples


def test_a_random_score_reaches_the_mean_soft_label_and_the_labels_themselves_1():
    rng = np.random.default_rng(0)
    soft = [200 + 4 * sum(math.sqrt(1 - d / length) for d in range(1, length // 2 + 1)) for length in range(101)]
    assert np.mean([vus_pr(TRACE, rng.random(10_000), 100) for _ in range(10)]) == pytest.approx(np.mean(soft) / 10_000, rel=0.1)
    assert vus_pr(TRACE, np.ones(10_000), 100) == pytest.approx(np.mean(soft) / 10_000)  # flags all or none
    assert vus_pr(TRACE, TRACE, 100) == 1


def test_a_late_score_is_forgiven_within_the_buffer():
    late = np.roll(TRACE, 30)
    assert vus_pr(TRACE, late, 0) == pytest.approx(0.7 * 0.7 + 0.3 * 0.02)  # 70 of 100 samples; then all the rest at once
    assert 0.75 < vus_pr(TRACE, late, 200) < 1
    assert vus_pr(TRACE, np.roll(TRACE, 1_000), 200) < 0.1


@pytest.mark.parametrize(
    ("labels", "scores", "words"), [([0, 0], [1, 2], "0 anomalous"), ([0, 1], [1, np.nan], "1 nan"), ([0, 1], [1, 2, 3], "(2,) and (3,)")]
)
def test_volumes_that_are_refused(refused, labels, scores, words):
    with refused(words):
        vus_pr(labels, scores, 3)
