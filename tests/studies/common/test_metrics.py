"""The volume under a surface, compared with a case by hand and a direct implementation of VUS-PR."""

import math

import numpy as np
import pytest

from studies.common.metrics import vus_pr


def volume_by_the_definition(labels, ranges, scores, max_buffer):
    """Threshold after threshold, buffer after buffer, sample after sample; `ranges` are first and last samples."""
    areas = []
    for length in range(max_buffer + 1):
        soft = [0.0] * len(labels)
        for begin, end in ranges:
            for place in range(len(labels)):
                distance = max(begin - place, place - end, 0)
                if distance == 0 or distance <= length / 2:
                    soft[place] = max(
                        soft[place], 1.0 if distance == 0 else math.sqrt(1 - distance / length)
                    )
        area, before = 0.0, 0.0
        for level in sorted(set(scores), reverse=True):
            alarms = [place for place, score in enumerate(scores) if score >= level]
            found = sum(soft[place] for place in alarms)
            expected = sum(labels) + sum(soft[place] for place in alarms if not labels[place]) / 2
            seen = sum(
                any(begin - length // 2 <= place <= end + length // 2 for place in alarms)
                for begin, end in ranges
            )
            reached = min(1, found / expected) * seen / len(ranges)
            area += (reached - before) * found / len(alarms)
            before = reached
        areas.append(area)
    return sum(areas) / len(areas)


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
    [[(20, 29)], [(0, 3), (56, 59)], [(10, 11), (14, 19), (40, 40)], [(0, 59)], [(5, 5), (30, 30)]],
    ids=["inside", "edges", "overlapping buffers", "all", "points"],
)
def test_volume_is_that_of_the_definition(ranges, seed):
    rng = np.random.default_rng(seed)
    labels = np.array([any(begin <= place <= end for begin, end in ranges) for place in range(60)])
    scores = (
        rng.random(60) + 0.5 * labels if seed % 2 else rng.integers(0, 7, 60)
    )  # without and with ties
    for max_buffer in (0, 5, 16):
        expected = volume_by_the_definition(labels, ranges, scores.tolist(), max_buffer)
        assert vus_pr(labels, scores, max_buffer) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("labels", "scores", "words"),
    [
        ([0, 0], [1, 2], "0 anomalous"),
        ([0, 1], [1, np.nan], "1 nan"),
        ([0, 1], [1, 2, 3], "(2,) and (3,)"),
    ],
)
def test_volumes_that_are_refused(refused, labels, scores, words):
    with refused(words):
        vus_pr(labels, scores, 3)
