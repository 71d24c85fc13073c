"""Where anomalies are injected whose onset is known."""

import numpy as np
import pytest

from studies.public_benchmarks.judging import Judge
from studies.public_benchmarks.onsets import draw_place


@pytest.mark.parametrize("seed", range(5))
def test_places_lie_in_nominal_time_a_window_or_more_from_labels(seed):
    judge = Judge(((100, 120),), 300, 10)
    place = draw_place(judge, np.random.default_rng(seed))
    assert judge.is_nominal[place.first : place.last].all() and place.last - place.first == 80
    assert (place.begin, place.end) == (40, 60)


def test_there_is_no_place_where_nominal_time_is_short():
    assert draw_place(Judge(((70, 120),), 200, 10), np.random.default_rng(0)) is None
