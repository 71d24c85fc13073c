import dataclasses

import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.settings import AUTHOR, OURS, PAPER, Settings, decisions, make_settings

FIELDS = dataclasses.fields(Settings)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("initialisers", "he_uniform"),
        ("dropout", "0"),
        ("latent_scale", "6.2832"),
        ("update", "mixed 200 + 200"),
        ("update", "two of 200"),
        ("average", "trailing"),
        ("learning_rate", "0.01"),
        ("num_windows", "15000"),
    ],
)
def test_each_reading_is_one_setting_away_from_the_reference(name, value):
    reading, reference = make_settings(**{name: value}), make_settings()
    assert {field.name for field in FIELDS if getattr(reading, field.name) != getattr(reference, field.name)} == {name}


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
    ],
)
def test_a_setting_that_cannot_be_used_is_refused(changed):
    with pytest.raises(InputError, match="Expected .* Received: "):
        make_settings(**changed)


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_every_setting_has_a_source_and_what_the_source_says(field):
    about = field.metadata
    assert about["source"] in (PAPER, AUTHOR, OURS)
    assert about["why"]
    assert about["paper"] if about["source"] == PAPER else True
    assert about["author"] if about["source"] == AUTHOR else True


def test_a_value_of_the_paper_wins_over_one_of_the_author():
    assert [row["setting"] for row in decisions() if row["source"] == AUTHOR and row["paper"].replace(",", "").isdigit()] == []


def test_smoke_changes_counts_only():
    smoke, full = make_settings("smoke"), make_settings()
    changed = {field.name for field in FIELDS if getattr(smoke, field.name) != getattr(full, field.name)}
    assert changed and all(type(getattr(full, name)) is int for name in changed)


def test_the_enhancer_does_not_depend_on_the_settings_of_the_gan():
    reference = make_settings()
    for change in ({"dropout": 0}, {"update": "two of 200"}, {"latent_scale": 4}, {"average": "trailing"}):
        assert make_settings(**change).of("windows", "enhancer") == reference.of("windows", "enhancer")
    assert make_settings(num_windows=15_000).of("windows", "enhancer") != reference.of("windows", "enhancer")
