"""Tests the verdicts over several seeds: of most of them, of each alone, and the ranges of the statistics."""

import pytest

from enhsim_tf.reproduce.paper.over_seeds import is_tie, of_most, ranges, title_verdict, titles_of_seeds, verdict_over

YES, PARTLY, NO, NOT_TESTED, NOT_MEASURED = "reproduced", "partly", "not reproduced", "not tested by the paper", "not measured"


@pytest.mark.parametrize(
    ("verdicts", "title"),
    [
        ([YES, YES, NOT_TESTED], "[Re]"),
        ([YES, YES, NOT_MEASURED, NOT_TESTED], "[Re]"),
        ([YES, PARTLY, NOT_TESTED], "[Re, in part]"),
        ([YES, PARTLY, NO], "[¬Re]"),
    ],
)
def test_title_contains_the_overall_verdict(verdicts, title):
    assert title_verdict([{"id": str(number), "verdict": verdict} for number, verdict in enumerate(verdicts)]) == title


def test_title_follows_the_verdict_of_most_seeds_and_the_worse_on_a_tie():
    assert [of_most(verdicts) for verdicts in ([YES, NO, NO], [YES, YES, NO], [YES, NO], [PARTLY, YES], [NOT_TESTED] * 2)] == [
        *(NO, YES, NO, PARTLY, NOT_TESTED)
    ]
    records = [{"id": "C1", "verdict": YES}, {"id": "C6", "verdict": PARTLY}]

    def spread(*verdicts):
        return {"claims": {"C1": {"verdicts": [YES] * 3}, "C6": {"verdicts": verdicts}}}

    assert title_verdict(records) == title_verdict(records, spread(PARTLY, PARTLY, NO)) == "[Re, in part]"
    assert title_verdict(records, spread(PARTLY, NO, NO)) == "[¬Re]" and title_verdict(records, spread(PARTLY, YES, YES)) == "[Re]"


def test_a_tie_is_of_the_largest_counts():
    assert is_tie([YES, NO]) and is_tie([YES, YES, NO, NO, PARTLY]) and not is_tie([YES, YES, NO, PARTLY]) and not is_tie([YES] * 3)


def test_the_title_by_each_seed_alone():
    records = [{"id": "C1", "verdict": YES}, {"id": "C6", "verdict": PARTLY}, {"id": "C8", "verdict": NOT_TESTED}]
    verdicts = {"C1": [YES] * 3, "C6": [PARTLY, NO, YES], "C8": [NOT_TESTED] * 3}
    spread = {"seeds": [0, 1, 2], "claims": {name: {"verdicts": each} for name, each in verdicts.items()}}
    assert titles_of_seeds(records, spread) == ["[Re, in part]", "[¬Re]", "[Re]"]
    assert [verdict_over(record, spread) for record in records] == [YES, NO, NOT_TESTED], "on a tie, the worst"
    assert verdict_over(records[1], None) == PARTLY


def test_ranges_over_seeds_by_hand():
    def record(value, verdict, **details):
        return [
            {"id": "C1", "value": value, "verdict": verdict, "details": details},
            {"id": "C9", "value": None, "verdict": "x", "details": {}},
        ]

    found = ranges({0: record(0.3, YES, a=1.0, b=5.0), 1: record(0.1, NO, a=3.0, b=4.0), 2: record(0.2, YES, a=2.0, b=6.0)}, "smoke")
    assert (found["budget"], found["seeds"], list(found["claims"])) == ("smoke", [0, 1, 2], ["C1", "C9"])
    first, second = found["claims"].values()
    assert first["range"] == [0.1, 0.3] and first["values"] == [0.3, 0.1, 0.2] and first["verdicts"] == [YES, NO, YES]
    assert first["details"] == {"a": [1.0, 3.0], "b": [4.0, 6.0]}
    assert second["range"] is None and second["verdicts"] == ["x"] * 3 and second["details"] == {}
