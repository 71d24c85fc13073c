"""Tests of parts that each count from zero, in one table or in a file each."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.sources import read_telemetry
from tests.telemetry.robot import follow

LENGTHS = (30, 20, 25)
TESTS = [
    pd.DataFrame(
        {
            "unit": 7 - number,
            "time": np.arange(float(length)),
            "volts": np.sin(np.arange(length) + number),
            "amperes": np.cos(np.arange(length) * 0.7 + number),
        }
    )
    for number, length in enumerate(LENGTHS)
]
TOGETHER = pd.concat(TESTS, ignore_index=True)
WORDS = TOGETHER.assign(unit=TOGETHER.unit.map("u{}".format))
COUNTED = TOGETHER.rename(columns={"time": "sample"}).astype({"sample": int})


def check_parts(telemetry):
    """Asserts that telemetry has the tests as its parts, 100 s apart."""
    assert telemetry.columns == ("volts", "amperes")
    assert [part.offset_s for part in telemetry.parts] == [0, 100, 200]
    for part, test in zip(telemetry.parts, TESTS, strict=True):
        np.testing.assert_array_equal(part.values, test[["volts", "amperes"]].astype(np.float32))


@pytest.mark.parametrize(
    ("table", "time"),
    [
        (TOGETHER, None),
        (COUNTED, "sample"),
        (WORDS, None),
    ],
    ids=["times", "samples", "words"],
)
def test_a_column_tells_parts_apart(table, time):
    (telemetry,) = read_telemetry(table, Cleaning(part_column="unit"), time=time)
    check_parts(telemetry)


def test_each_file_is_a_part(tmp_path):
    for number, test in enumerate(TESTS):
        # a header that is repeated inside of a file begins no part
        lines = test.drop(columns="unit").to_csv(index=False).splitlines()
        (tmp_path / f"{number}.csv").write_text(
            "\n".join([*lines[:9], lines[0], *lines[9:]]) + "\n"
        )
    (telemetry,) = read_telemetry(tmp_path, Cleaning(part_column="file"))
    check_parts(telemetry)


def test_files_of_one_name_in_different_folders_are_parts(tmp_path):
    paths = [tmp_path / str(number) / "test.csv" for number in range(len(TESTS))]
    for path, test in zip(paths, TESTS, strict=True):
        path.parent.mkdir()
        test.drop(columns="unit").to_csv(path, index=False)
    (telemetry,) = read_telemetry(paths, Cleaning(part_column="file"))
    check_parts(telemetry)


def test_parts_are_further_apart_than_gaps_that_are_filled():
    cleaning = Cleaning(part_column="unit", max_fill=100)
    (telemetry,) = read_telemetry(TOGETHER, cleaning)
    assert [part.offset_s for part in telemetry.parts] == [0, 1_000, 2_000]
    assert [len(part) for part in telemetry.parts] == list(LENGTHS)


@pytest.mark.parametrize(
    "table",
    [
        TOGETHER.sort_values(["time", "unit"], ascending=[True, False], kind="stable"),
        TOGETHER.loc[TOGETHER.index.repeat(2)],
    ],
    ids=["interleaved", "each row twice"],
)
def test_the_order_of_the_rows_of_different_parts_does_not_matter(table):
    (telemetry,) = read_telemetry(table.reset_index(drop=True), Cleaning(part_column="unit"))
    check_parts(telemetry)


def test_the_latest_row_may_come_first():
    (telemetry,) = read_telemetry(
        TOGETHER[::-1].reset_index(drop=True), Cleaning(part_column="unit")
    )
    check_parts(telemetry)


def test_late_rows_do_not_split_a_part():
    late = [*range(10), *range(13, 16), *range(10, 13), *range(16, len(TOGETHER))]
    table = TOGETHER.iloc[late].reset_index(drop=True)
    (telemetry,) = read_telemetry(table, Cleaning(part_column="unit"))
    check_parts(telemetry)


def test_parts_of_sensors_one_below_the_other_are_numbered_for_each(tmp_path):
    long = TOGETHER.melt(["unit", "time"], var_name="sensor")
    (telemetry,) = read_telemetry(long, Cleaning(part_column="unit", series_column="sensor"))
    check_parts(telemetry)


@pytest.mark.parametrize("column", ["amperes", "none"])
def test_a_column_that_tells_no_parts_apart_is_refused(column):
    with pytest.raises(InputError, match="part_column|a column of"):
        read_telemetry(TOGETHER, Cleaning(part_column=column))


def test_parts_are_further_apart_than_gaps_of_a_given_interval():
    table = TOGETHER.assign(time=TOGETHER.time / 10)
    cleaning = Cleaning(part_column="unit", interval_s=1)
    (telemetry,) = read_telemetry(table, cleaning)
    assert [len(part) for part in telemetry.parts] == [4, 3, 3]  # 2.9, 1.9 and 2.4 s


def test_a_value_that_comes_again_is_another_part():
    table = TOGETHER.assign(unit=np.repeat([1, 2, 1], LENGTHS))
    (telemetry,) = read_telemetry(table, Cleaning(part_column="unit"))
    check_parts(telemetry)


def test_a_part_begins_at_its_own_first_time():
    table = TOGETHER.assign(time=TOGETHER.time + np.where(TOGETHER.unit == 6, 15, 0))
    (telemetry,) = read_telemetry(table, Cleaning(part_column="unit"))
    assert [part.offset_s for part in telemetry.parts] == [0, 115, 200]


@pytest.mark.parametrize(
    "table",
    [TOGETHER, COUNTED, WORDS.rename(columns={"unit": "trial"})],
    ids=["times", "samples", "words"],
)
def test_advice_where_times_begin_again_tells_the_parts_apart(tmp_path, table):
    path = tmp_path / "tests.csv"
    table.to_csv(path, index=False)
    first = follow([str(path)])[0]
    assert first.options[-1].endswith(f"--part-column {table.columns[0]}")
    assert [len(part) for part in first.channels["volts"].telemetry.parts] == list(LENGTHS)
    assert table.columns[0] not in first.channels


def test_advice_for_files_over_the_same_times_takes_each_as_a_part(tmp_path):
    for number, test in enumerate(TESTS):
        test.drop(columns="unit").to_csv(tmp_path / f"{number}.csv", index=False)
    (ending,) = follow([str(tmp_path)])
    assert ending.options == ("--part-column file",)
    assert [len(part) for part in ending.channels["volts"].telemetry.parts] == list(LENGTHS)


@pytest.mark.parametrize(
    "table",
    [
        TOGETHER.drop(columns="time"),
        TOGETHER.assign(time=pd.date_range("2024-03-01", periods=len(TOGETHER), freq="s")),
    ],
    ids=["no clock", "dates"],
)
def test_parts_without_times_that_count_are_refused(table):
    with pytest.raises(InputError, match="times that count in each part"):
        read_telemetry(table, Cleaning(part_column="unit"))


def test_parts_that_do_not_fit_one_after_another_are_refused():
    table = TOGETHER.assign(time=TOGETHER.time * 1e4)  # apart by more than 1e10 s
    with pytest.raises(InputError, match="fit into 292 years"):
        read_telemetry(table, Cleaning(part_column="unit", max_fill=1_000_000, time_format="s"))


def test_an_unknown_part_column_is_refused():
    with pytest.raises(InputError, match="'engine'"):
        read_telemetry(TOGETHER, Cleaning(part_column="engine"))
