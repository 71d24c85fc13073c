"""Times in forms that only a rule tells apart, each worked by hand."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.cleaning.times import (
    date_forms,
    parse_times,
    refuse_steps_back,
    refuse_two_meanings,
)

DAY = 45_000.0  # of a spreadsheet: 2023-03-15


@pytest.mark.parametrize("step", [1 / 24, 1 / 1_440, 0.1 / 86_400])
def test_steps_of_whole_hours_minutes_or_tenth_seconds_look_like_days(refused, step):
    with refused("may be days", "excel from 2023-03-15"):
        refuse_two_meanings(DAY + step * np.arange(5), "clock")


@pytest.mark.parametrize("step", [1.0, 0.25, 0.01 / 86_400, 2.3 / 864_000])
def test_other_steps_do_not(step):
    refuse_two_meanings(DAY + step * np.arange(5), "clock")


def test_whole_days_do_in_a_column_of_dates(refused):
    with refused("may be days"):
        refuse_two_meanings(DAY + np.arange(5), "date", is_date=True)


def test_a_damaged_number_in_text_is_marked_and_the_others_are_read():
    times = parse_times(pd.Series(["0", "x", "2", "3"]), "clock", drop=True)
    assert times.bad.tolist() == [False, True, False, False]
    assert times.stamps[[0, 2, 3]].second.tolist() == [0, 2, 3]


def test_whole_numbers_with_a_fraction_column_are_read_by_their_format():
    times = parse_times(pd.Series([2024061.0, np.nan, 2024062.0]), "clock", form="%Y%j")
    assert times.stamps[[0, 2]].strftime("%m-%d").tolist() == ["03-01", "03-02"]


@pytest.mark.parametrize(
    ("numbers", "form"),
    [
        ([5, np.nan, 130], "%H%M"),
        ([500, np.nan, 13_000], "%H%M%S"),
        ([500.5, np.nan, 13_000.25], "%H%M%S.%f"),
    ],
)
def test_numbers_that_lost_the_zeros_of_their_time_of_day_are_read_by_their_format(numbers, form):
    times = parse_times(pd.Series(numbers), "clock", form=form)
    assert times.stamps[[0, 2]].strftime("%H:%M").tolist() == ["00:05", "01:30"]
    assert times.stamps[0].microsecond == round(numbers[0] % 1 * 1e6)


def test_times_of_day_in_numbers_are_refused_with_their_format(refused):
    with refused("times of day", "--time-format %H%M%S"):
        refuse_two_meanings(np.array([115_958.0, 115_959.0, 120_000.0, 120_001.0]), "clock")


@pytest.mark.parametrize(
    ("text", "form"),
    [
        ("2024-061", "%Y-%j"),
        ("1/13/2024 1:05 PM", "%m-%d-%Y %I:%M %p"),
        ("13.1.2024 1:05:07.5", "%d-%m-%Y %H:%M:%S.%f"),
    ],
)
def test_the_form_of_dates(text, form):
    mark = next(each for each in text if not each.isdigit())
    assert date_forms(pd.Series([text])) == [form.replace("-", mark)]


class Log:
    channel = "volts"
    counts = False

    def place(self, number):
        return f"row {number}"


def refuse_minutes(minutes, order=1, has_zone=False):
    """Refuses rows in another order than that of their times if their clock steps back."""
    times = 60 * 10**9 * np.array(minutes)[::order]
    refuse_steps_back(times, np.arange(len(minutes))[::order], Log(), has_zone)


@pytest.mark.parametrize("minutes", [[0, 20, 40, 60, 0, 20, 40], [0, 20, 20, 40, 60, 0, 20, 40]])
def test_times_that_step_back_by_an_hour_are_refused(refused, minutes):
    with refused(f"row {len(minutes) - 3} of volts", "--timezone"):
        refuse_minutes(minutes)


@pytest.mark.parametrize(
    ("minutes", "words"),
    [([1_400, 1_420, 0, 20], "one day"), ([120, 140, 80, 100], "one hour")],
)
def test_a_step_back_by_a_day_or_an_hour_is_refused_unless_a_zone_is_known(refused, minutes, words):
    with refused("row 2 of volts", words):
        refuse_minutes(minutes)
    refuse_minutes(minutes, has_zone=True)


@pytest.mark.parametrize(
    ("minutes", "row"), [([*range(60), *range(20, 80)], 60), ([*range(20)] * 6, 20)]
)
@pytest.mark.parametrize("has_zone", [False, True])
@pytest.mark.parametrize("order", [1, -1])
def test_dates_that_begin_again_are_refused(refused, minutes, row, has_zone, order):
    with refused(f"row {row} of volts", "cover the same time once more"):
        refuse_minutes(minutes, order, has_zone)


def test_hours_from_1_to_12_are_refused(refused):
    with refused("hours from 1 to 12"):
        refuse_minutes([60 * hour for hour in (10, 11, 12, 1, 2, 3, 4)])


def test_blocks_in_another_order_are_no_steps_of_a_clock():
    refuse_minutes([60 * hour for hour in (12, 14, 16, 18, 6, 8, 10)])


def test_what_fills_a_gap_late_is_no_clock_that_was_set():
    blocks = [range(200, 400), range(200), range(400, 500), range(540, 600), range(500, 540)]
    refuse_minutes([minute for block in blocks for minute in block], has_zone=True)


@pytest.mark.parametrize("minutes", [1, 10, 20, 30, 60, 240, 720, 1_440])
def test_dates_that_go_down_throughout_begin_nowhere_again(minutes):
    refuse_minutes(minutes * np.arange(400)[::-1])
