import dataclasses
import zlib

import pytest

from enhsim_tf.paper.report import decisions
from enhsim_tf.paper.settings import AUTHOR, OURS, PAPER, Settings, make_settings

FIELDS = dataclasses.fields(Settings)


def changed_by(settings):
    return {
        field.name
        for field in FIELDS
        if getattr(settings, field.name) != getattr(make_settings(), field.name)
    }


@pytest.mark.parametrize(
    ("name", "value", "is_of_enhancer"),
    [
        ("initialisers", "he_uniform", True),
        ("dropout", "0", False),
        ("latent_scale", "6.2832", False),
        ("update", "mixed 200 + 200", False),
        ("update", "two of 200", False),
        ("average", "trailing", False),
        ("learning_rate", "0.01", True),
        ("num_windows", "15000", True),
    ],
)
def test_each_reading_is_one_setting_away_from_the_reference(name, value, is_of_enhancer):
    reading, reference = make_settings(**{name: value}), make_settings()
    assert changed_by(reading) == {name}
    assert (
        reading.of("windows", "enhancer") != reference.of("windows", "enhancer")
    ) == is_of_enhancer


@pytest.mark.parametrize(
    "changed",
    [
        {"no_such": 1},
        {"dropout": "much"},
        {"average": "padded"},
        {"epochs": "2.5"},
        {"epochs": -1},
        {"fast": 3},
        {"window": 10},
        {"record_every": 0},
        {"record_every": 300},
        {"dropout": 1},
        {"record_every": 1_000},
        {"epochs": 2.7},
        {"epochs": float("inf")},
        {"rows": 1},
        {"false_alarm_rate": 1},
        {"moving_average": 24},
        {"orbit_period": 0},
    ],
)
def test_a_setting_that_cannot_be_used_is_refused(changed, refused):
    with refused():
        make_settings(**changed)


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_every_setting_has_a_source_and_what_the_source_says(field):
    about = field.metadata
    assert about["source"] in (PAPER, AUTHOR, OURS)
    assert about["why"]
    assert about["source"] == OURS or about["paper" if about["source"] == PAPER else "author"]


@pytest.mark.parametrize(
    ("stages", "checksum"),
    [
        ("telemetry", 3773355024),
        ("windows, enhancer", 1149771168),
        ("windows, noise, noise GAN", 780319444),
        ("windows, noise, claims", 4169788998),
    ],
)
def test_the_reference_is_written_as_ever(stages, checksum):
    written = repr(make_settings().of(*stages.split(", ")))
    assert zlib.crc32(written.encode()) == checksum, (
        "another text gives another key, so that the stages of former runs are done again"
    )


def test_a_value_of_the_paper_wins_over_one_of_the_author():
    assert [
        row["setting"]
        for row in decisions()
        if row["source"] == AUTHOR and row["paper"].replace(",", "").isdigit()
    ] == []


def test_smoke_changes_counts_only():
    changed = changed_by(make_settings("smoke"))
    assert changed and all(type(getattr(make_settings(), name)) is int for name in changed)
