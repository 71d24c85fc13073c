"""Tables in the forms that people have: each is read with the right times and values, or refused in
one line that says what to do.
"""

import gzip
import zipfile

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.inject import inject
from enhsim_tf.datasets.label_columns import write_table
from enhsim_tf.datasets.options import InjectOptions
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.times import epoch_unit
from enhsim_tf.telemetry.reading.columns import anomalous
from enhsim_tf.telemetry.sources import read_source, read_telemetry

N = 60
VALUES = (20 + 5 * np.sin(np.arange(N) / 5)).round(2)
START = pd.Timestamp("2024-03-01T00:00:00Z")
TIMES = pd.date_range(START, periods=N, freq="min")
SECONDS = 60 * np.arange(N)
DAYS = TIMES + pd.Timedelta("23h30min")  # over midnight


def table(header, *columns, separator=",", above="", below=""):
    rows = [separator.join(map(str, cells)) for cells in zip(*columns, strict=True)]
    return above + "\n".join([header, *rows]) + "\n" + below


def stamps(form):
    return TIMES.strftime(form)


def commas(values):
    return [str(value).replace(".", ",") for value in values]


def only(channels):
    (series,) = channels.values()
    return series


def check(series, values=VALUES, start=START, interval_s=60.0, options=None):
    """Checks that a channel is one part with the expected times and values; returns its report."""
    cleaned = clean(series, options)
    (part,) = cleaned.parts
    assert part.interval_s == pytest.approx(interval_s, rel=1e-6)
    if start is None:
        assert part.start is None
    else:
        assert abs(pd.Timestamp(part.start) - start) <= pd.Timedelta("2ms")
    np.testing.assert_allclose(part.values[:, 0], values, atol=1e-5)
    return cleaned.report


ZERO = pd.Timestamp(0, tz="UTC")
MINUTES, UTC = stamps("%Y-%m-%d %H:%M"), stamps("%Y-%m-%dT%H:%M:%SZ")
# form: text, start of the series
READ = {
    "hundreds of blank lines": (
        table("time,v", UTC, VALUES).replace("v\n", "v\n" + "\n" * 400, 1),
        START,
    ),
    "dates and times of day as numbers": (
        table("Date,HHMM,v", DAYS.strftime("%d.%m.%Y"), DAYS.strftime("%-H%M"), VALUES),
        DAYS[0],
    ),
    "compact dates and times of day with seconds": (
        table(
            "Date,HHMMSS UTC,v", *(DAYS.strftime(form) for form in ("%Y%m%d", "%-H%M%S")), VALUES
        ),
        DAYS[0],
    ),
    "the day of the year, and 2400 at its end": (
        table(
            "Year,DOY,HHMM,v",
            *((DAYS - pd.Timedelta("1min")).strftime(form) for form in ("%Y", "%j")),
            [f"{time:%-H%M}".replace("000", "2400") for time in DAYS],
            VALUES,
        ),
        DAYS[0],
    ),
    "a compact date, hours and minutes": (
        table("Date,Hour,Minute,v", *(stamps(form) for form in ("%Y%m%d", "%H", "%M")), VALUES),
        START,
    ),
    "a compact date that is named by its form": (
        table("YYYYMMDD,HH,Minute,v", *(stamps(form) for form in ("%Y%m%d", "%H", "%M")), VALUES),
        START,
    ),
    "the beginning and the end of samples without length, each as a date and a time": (
        table("day,clock,day2,clock2,v", *(stamps(form) for form in ("%F", "%T") * 2), VALUES),
        START,
    ),
    "a line of formats": (
        table(
            "agency_cd\tdatetime\t69928_00060\n5s\t20d\t14n",
            ["USGS"] * N,
            UTC,
            VALUES,
            separator="\t",
        ),
        START,
    ),
    "ISO 8601 with a comma": (
        table("time;v", stamps("%Y-%m-%d %H:%M:%S,500"), VALUES, separator=";"),
        START + pd.Timedelta("500ms"),
    ),
    "UTC in words": (table("time,v", stamps("%Y-%m-%d %H:%M:%S UTC"), VALUES), START),
    "day of year": (table("time,v", stamps("%Y-%jT%H:%M:%S"), VALUES), START),
    "day of year with colons": (table("time,v", stamps("%Y:%j:%H:%M:%S.%f"), VALUES), START),
    "day, month in letters": (table("Time,v", stamps("%d-%b-%Y %H:%M:%S"), VALUES), START),
    "month in letters first": (
        table("Time;v", stamps("%b %d, %Y %H:%M:%S"), VALUES, separator=";"),
        START,
    ),
    "a web server's": (table("time,v", stamps("%d/%b/%Y:%H:%M:%S +0000"), VALUES), START),
    "points": (table("Zeit;U", stamps("%d.%m.%Y %H:%M:%S"), commas(VALUES), separator=";"), START),
    "slashes, the year first": (table("t,v", stamps("%Y/%m/%d %H:%M"), VALUES), START),
    "date and time of day": (
        table("date,clock,v", stamps("%Y-%m-%d"), stamps("%H:%M:%S"), VALUES),
        START,
    ),
    "year and day of year": (
        table(
            "Year,DOY,Hour,Min,v", stamps("%Y"), stamps("%j"), stamps("%H"), stamps("%M"), VALUES
        ),
        START,
    ),
    "year, month and day": (
        table("YYYY,MM,DD,HH,mn,v", *(stamps(f"%{part}") for part in "YmdHM"), VALUES),
        START,
    ),
    "a compact date and a time of day": (
        table("Date,Time,v", stamps("%Y%m%d"), stamps("%H:%M:%S"), VALUES),
        START,
    ),
    "months and minutes": (
        table("YYYY,MM,DD,hh,mm,v", *(stamps(f"%{part}") for part in "YmdHM"), VALUES),
        START,
    ),
    "a date in the first row of the day": (
        table("date,clock,v", ["2024-03-01"] + [""] * (N - 1), stamps("%H:%M:%S"), VALUES),
        START,
    ),
    "a date, hours and minutes": (
        table(
            "date,hour,minute,v", stamps("%Y-%m-%d"), *(stamps(f"%{part}") for part in "HM"), VALUES
        ),
        START,
    ),
    "whole seconds and milliseconds": (
        table("time,ms,v", stamps("%Y-%m-%d %H:%M:%S"), [70] * N, VALUES),
        START + pd.Timedelta("70ms"),
    ),
    "half days in a column": (
        table("day,clock,half,v", stamps("%d.%m.%Y"), stamps("%I:%M:%S"), stamps("%p"), VALUES),
        START,
    ),
    "years of two digits": (
        table("Zeit;v", stamps("%d.%m.%y %H:%M"), commas(VALUES), separator=";"),
        START,
    ),
    "years of two digits behind letters": (
        table("time,v", stamps("%d-%b-%y %H:%M"), VALUES),
        START,
    ),
    "midnight as hour 24": (
        table("time,v", stamps("%Y-%m-%d %H:%M"), VALUES).replace(
            "2024-03-01 00:00", "2024-02-29 24:00"
        ),
        START,
    ),
    "names that count": (table(",0", MINUTES, VALUES), START),
    "an oscilloscope's": (table("x-axis,1\nsecond,Volt", SECONDS, VALUES), ZERO),
    "a date with a blank between blanks": (
        table("time v", stamps("%Y-%m-%d %H:%M:%S"), VALUES, separator=" "),
        START,
    ),
    "milliseconds since boot": (table("time_boot_ms,v", 1000 * SECONDS, VALUES), ZERO),
    "seconds of the day": (
        table("year,doy,sod,v", stamps("%Y"), stamps("%j"), SECONDS, VALUES),
        START,
    ),
    "milliseconds in a third column": (
        table("date,clock,ms,v", stamps("%Y-%m-%d"), stamps("%H:%M:%S"), [70] * N, VALUES),
        START + pd.Timedelta("70ms"),
    ),
    "a unit below the name": (
        table("Time,v", 1000 * SECONDS, VALUES).replace("v\n", "v\n[ms],V\n", 1),
        ZERO,
    ),
    "a unit and a blank line below the name": (
        table("Time,v", SECONDS / 60, VALUES).replace("v\n", "v\n(min),V\n\n", 1),
        ZERO,
    ),
    "a sign for the row number": (table("#,time,v", range(N), MINUTES, VALUES), START),
    "MATLAB's comments": (table("% Time, v", SECONDS, VALUES, above="% Model: a\n"), ZERO),
    "names in two lines": (table(",v", MINUTES, VALUES).replace(",v\n", ",v\ntime,V\n", 1), START),
    "the newest row first": (table("time,v", SECONDS[::-1], VALUES[::-1]), ZERO),
    "seconds in brackets": (table("Time (s),v", SECONDS, VALUES), ZERO),
    "milliseconds in the name": (table("timestamp_ms,v", 1000 * SECONDS, VALUES), ZERO),
    "minutes elapsed": (table("elapsed [min],v", np.arange(N), VALUES), ZERO),
    "capitals in the name": (table("SimTime,v", SECONDS, VALUES), ZERO),
    "seconds written out": (table("Time,v", [f"{second} sec" for second in SECONDS], VALUES), ZERO),
    "a temperature beside the time": (table("time,T", SECONDS, VALUES), ZERO),
    "milliseconds since 1970": (table("timestamp,v", TIMES.as_unit("ms").asi8, VALUES), START),
    "modified Julian dates": (
        table("MJD,v", [f"{60370 + second / 86400:.9f}" for second in SECONDS], VALUES),
        START,
    ),
    "Julian dates": (
        table("JD,v", [f"{2460370.5 + second / 86400:.9f}" for second in SECONDS], VALUES),
        START,
    ),
    "MATLAB's days": (
        table("datenum,v", [f"{739312 + second / 86400:.9f}" for second in SECONDS], VALUES),
        START,
    ),
    "the time once more": (
        table("date,epoch,v", stamps("%Y-%m-%d %H:%M:%S"), TIMES.as_unit("s").asi8, VALUES),
        START,
    ),
    "numbers of a server's entries": (
        table("time,entry_id,v", UTC, range(700, 700 + N), VALUES),
        START,
    ),
    "quality after capitals": (table("time,v,OPCQuality", UTC, VALUES, [192] * N), START),
    "an offset in the name": (
        table('"Time, GMT+02:30",v', stamps("%Y-%m-%d %H:%M"), VALUES),
        START - pd.Timedelta("2.5h"),
    ),
    "row numbers of a table of which rows were left out": (
        table("Unnamed: 0,time,v", 3 * np.arange(N) ** 2, UTC, VALUES),
        START,
    ),
    "intervals in one cell": (
        table(
            "period;v",
            [f"{a}/{b}" for a, b in zip(UTC, (*UTC[1:], UTC[0]), strict=True)],
            VALUES,
            separator=";",
        ),
        START,
    ),
    "the time within a step, named by t": (
        table("Time[s],t-Step[s],v", SECONDS, SECONDS % 600, VALUES),
        ZERO,
    ),
    "units of several columns in columns of one name": (
        table("time,Units,v,Units", UTC, ["C"] * N, VALUES, ["V"] * N),
        START,
    ),
    "row numbers of pandas": (table("Unnamed: 0,time,v", range(N), UTC, VALUES), START),
    "a spreadsheet's first line": (
        table("time;v", stamps("%Y-%m-%d %H:%M:%S"), VALUES, separator=";", above="\ufeffsep=;\n"),
        START,
    ),
    "names and units": (table("time,v", UTC, VALUES).replace("v\n", "v\n(UTC),V\n", 1), START),
    "a logger's four lines": (
        table(
            'TOA5,"a","7"\n"TIMESTAMP","RECORD","v"\n"TS","RN","V"\n"","","Smp"',
            UTC,
            range(N),
            VALUES,
        ),
        START,
    ),
    "lines about the measurement": (
        table("Version\t2\n***End***\t\n\nX_Value\tv", SECONDS, commas(VALUES), separator="\t"),
        ZERO,
    ),
    "NumPy's": (
        table("# time v", [f"{second:.6e}" for second in SECONDS], VALUES, separator=" "),
        ZERO,
    ),
    "NumPy's, with units": (table("# t [s]  v", SECONDS, VALUES, separator=" "), ZERO),
    "names and units in comments": (
        table(
            "#YY MM DD hh mm v\n#- - - - - m/s",
            *(stamps(f"%{part}") for part in "YmdHM"),
            VALUES,
            separator=" ",
        ),
        START,
    ),
    "day of year in UTC": (
        table("UTC,v", [f"{text[:-3]}Z" for text in stamps("%Y-%jT%H:%M:%S.%f")], VALUES),
        START,
    ),
    "a log cut by a power failure": (table("time,v", UTC, VALUES, below="\x00" * 300), START),
    "commas behind each line": (table("time,v,", UTC, VALUES, [""] * N), START),
    "a name without cells": (table("time,v,comment", UTC, VALUES), START),
    "tabs": (table("time\tv", UTC, VALUES, separator="\t"), START),
    "bars": (table("time|v", UTC, VALUES, separator="|"), START),
    "quoted decimal commas": (
        table("time,v", UTC, [f'"{value}"' for value in commas(VALUES)]),
        START,
    ),
    "a byte order mark": ("\ufeff" + table("time,v", UTC, VALUES), START),
    "comments above": (
        table("time,v", UTC, VALUES, above="# written by a recorder\n#units,V\n\n"),
        START,
    ),
    "spaces in the header": (table("time, v", UTC, VALUES), START),
    "lines of another system": (table("time,v", UTC, VALUES).replace("\n", "\r\n"), START),
    "a stray carriage return": ("\r" + table("time,v", UTC, VALUES), START),
    "no end of the last line": (table("time,v", UTC, VALUES).rstrip("\n"), START),
    "the time last, and words": (table("v,state,when", VALUES, ["on"] * N, UTC), START),
    "files joined with their headers": (
        table("time,v", UTC, VALUES).replace("\n2024-03-01T00:30", "\ntime,v\n2024-03-01T00:30"),
        START,
    ),
    "a stop of WinCC": (
        table(
            "VarName;TimeString;VarValue",
            ["T"] * N,
            UTC,
            VALUES,
            separator=";",
            below="$RT_OFF$;2024-03-01T01:00:00Z;0\n",
        ),
        START,
    ),
    "a time of day and microseconds": (
        table("date,clock,usec,v", stamps("%Y-%m-%d"), stamps("%H:%M:%S"), [70_000] * N, VALUES),
        START + pd.Timedelta("70ms"),
    ),
    "whole seconds and nanoseconds": (
        table("time,ns,v", stamps("%Y-%m-%d %H:%M:%S"), [7 * 10**7] * N, VALUES),
        START + pd.Timedelta("70ms"),
    ),
    "elapsed times beside a clock": (
        table(
            "timestamp,uptime,v",
            TIMES.as_unit("s").asi8,
            [f"{k // 60}:{k % 60:02d}:00" for k in range(1_410, 1_410 + N)],
            VALUES,
        ),
        START,
    ),
    "year, month, day and a time of day": (
        table("Year,Month,Day,Time,v", *(stamps(f"%{x}") for x in "Ymd"), stamps("%H:%M"), VALUES),
        START,
    ),
    "a date, hours, minutes and seconds": (
        table(
            "date,h,min,sec,v", stamps("%Y-%m-%d"), *(stamps(f"%{x}") for x in "HMS"), VALUES
        ).replace("date,h", "date,hour"),
        START,
    ),
    "midnight as the end of a day": (
        table(
            "date,clock,v",
            (TIMES + pd.Timedelta("23.49h")).strftime("%Y-%m-%d"),
            (TIMES + pd.Timedelta("23.5h")).strftime("%H:%M:%S"),
            VALUES,
        ).replace("2024-03-01,00:00:00", "2024-03-01,24:00:00"),
        START + pd.Timedelta("23.5h"),
    ),
    "halves of a day in small letters": (
        table("time,v", stamps("%Y-%m-%d %I:%M %p").str.lower(), VALUES),
        START,
    ),
    "seconds of the day beside hours and minutes": (
        table("Date,Time,sec,v", stamps("%Y-%m-%d"), stamps("%H:%M"), SECONDS + 1, VALUES),
        START,
    ),
    "minutes of the day": (
        table("year,doy,minute,v", stamps("%Y"), stamps("%j"), np.arange(N), VALUES),
        START,
    ),
    "a unit of one": (table("Time (1.0 s),v", SECONDS, VALUES), ZERO),
    "spans that fall": (
        table("time,v", [f"{s} s" for s in SECONDS[::-1]], VALUES[::-1]),
        ZERO,
    ),
    "a separator behind each row": (
        table("time,v,", 1 + np.arange(N) * 60, VALUES, [""] * N),
        ZERO + pd.Timedelta("1s"),
    ),
    "row names of R": (
        table(
            '"time" "v"', [f'"{1 + k}"' for k in range(N)], SECONDS + 1e-9, VALUES, separator=" "
        ),
        ZERO,
    ),
    "the day of a test beside its clock": (
        table("test_date,time_s,v", ["2024-03-01"] * N, SECONDS, VALUES),
        ZERO,
    ),
    "ISO 8601 durations": (table("time,v", [f"PT{60 * k}S" for k in range(N)], VALUES), ZERO),
    "elapsed times that pass a day late": (
        table("time,v", [f"{k // 60}:{k % 60:02d}:00" for k in range(1_410, 1_410 + N)], VALUES),
        ZERO + pd.Timedelta("23.5h"),
    ),
    "LabVIEW's clock for each channel": (
        table("X_Value,v,X_Value,Comment", SECONDS, VALUES, SECONDS),
        ZERO,
    ),
    "units behind all numbers": (table("time,v", UTC, [f"{value} °C" for value in VALUES]), START),
    "times of day without zeros": (
        table("date,time,v", stamps("%Y-%m-%d"), [f"{k.hour}:{k.minute}:0" for k in TIMES], VALUES),
        START,
    ),
    "dates of PVGIS": (table("time,v", stamps("%Y%m%d:%H%M"), VALUES), START),
    "beginning and end with a dash": (
        table("time,v", stamps("%d.%m.%Y %H:%M - 01.04.2024 00:00"), VALUES),
        START,
    ),
    "the time of TensorBoard": (
        table("Wall time,Step,v", 1_709_251_200.5 + SECONDS, range(N), VALUES),
        START + pd.Timedelta("0.5s"),
    ),
    "names in a comment above an empty one": (
        table("# time,v\n#", UTC, VALUES),
        START,
    ),
    "NaN of C": (table("time,v", UTC, VALUES).replace(f",{VALUES[30]}\n", ",-nan(ind)\n"), START),
}


@pytest.mark.parametrize("form", READ)
def test_a_form_is_read_with_its_times_and_values(tmp_path, form):
    text, start = READ[form]
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    values = (
        np.where(VALUES == VALUES[30], (VALUES[29] + VALUES[31]) / 2, VALUES)
        if form == "NaN of C"
        else VALUES
    )
    report = check(only(read_source(tmp_path / "a.csv")), values, start)
    clock = report.findings[0]
    assert (
        clock.kind == "clock"
        and clock.details["last_ns"] - clock.details["first_ns"] == (N - 1) * 60 * 10**9
    )


def dates(form, days):
    return pd.date_range(START, periods=N, freq=f"{days}D").strftime(form)


# form: text, words of the refusal, how it is read as the message says, the interval then
ASKED = {
    "a ramp": (
        table("counter,v", 5 * np.arange(N), VALUES),
        "--time counter",
        {"time": "counter"},
        5,
    ),
    "a name that is no clock's": (
        table("T,v", 5 * np.arange(N), VALUES),
        "--time T",
        {"time": "T"},
        5,
    ),
    "a ramp in front of each signal": (
        table("t1,v,t2,w", 5 * np.arange(N), VALUES, 2 * np.arange(N), VALUES),
        "--time t2 --column w",
        {"time": "t1", "columns": ["v"]},
        5,
    ),
    "times of day without colons from midnight": (
        table(
            "Time,v",
            [f"{number // 60:02}{number % 60:02}00" for number in 7 * SECONDS // 60],
            VALUES,
        ),
        "times of day or seconds",
    ),
    "days of a spreadsheet": (
        table("Date,v", [f"{45352 + second / 86400:.8f}" for second in SECONDS], VALUES),
        "excel from 2024-03-01",
        {"options": Cleaning(time_format="excel")},
        60,
    ),
    "year and day in one number": (
        table("date,v", dates("%Y%j", 1), VALUES),
        "%Y%j",
        {"options": Cleaning(time_format="%Y%j")},
        86_400,
    ),
    "the time first": (
        table("time,v", stamps("%H:%M:%S %d-%m-%Y"), VALUES),
        "at line 2",
        {"options": Cleaning(time_format="%H:%M:%S %d-%m-%Y")},
        60,
    ),
    "an unknown form of time": (
        table("when,v", stamps("%y-%jT%H:%M"), VALUES),
        "'24-061T00:00'",
        {"time": "none"},
        1,
    ),
    "times since 1970 without a name": (
        table(",v", TIMES.as_unit("s").asi8, VALUES),
        "--time 'column 0'",
        {"time": "column 0"},
        60,
    ),
    "date and hour in one number": (
        table("date,v", pd.date_range(START, periods=N, freq="h").strftime("%Y%m%d%H"), VALUES),
        "%Y%m%d%H",
        {"options": Cleaning(time_format="%Y%m%d%H")},
        3_600,
    ),
    "a date and a time of day with nothing between them": (
        table("time;v", stamps("%d.%m.%y%H:%M:%S"), VALUES, separator=";"),
        "--time-format",
        {"options": Cleaning(time_format="%d.%m.%y%H:%M:%S")},
        60,
    ),
    "times of day alone": (
        table("clock,v", stamps("%H:%M:%S"), VALUES),
        "--time-format %H:%M:%S",
        {"options": Cleaning(time_format="%H:%M:%S")},
        60,
    ),
    "a clock behind a counter": (
        table("Pt,T,v", range(N), SECONDS, VALUES),
        "--time T",
        {"time": "T"},
        60,
    ),
    "a clock that says more in its name": (
        table("n,time approx (s),v", range(N), SECONDS + np.arange(N) % 2, VALUES),
        "--time 'time approx (s)'",
        {"time": "time approx (s)"},
        60,
    ),
    "columns below lines of text": (
        table("[DATA]", MINUTES, VALUES, separator="\t", above="STATION 1\n[HEADER]\nheight = 3\n"),
        "--no-header",
        {"options": Cleaning(no_header=True)},
        60,
    ),
    "two clocks": (
        table("event_time,received_time,v", MINUTES, stamps("%Y-%m-%d %H:%M:01"), VALUES),
        "event_time, received_time",
        {"time": "event_time"},
        60,
    ),
    "states that change often": (
        table("time,mode,v", MINUTES, ["A", "B"] * 30, VALUES),
        "column mode",
        {"options": Cleaning(series_column="none")},
        60,
    ),
}
# form: text, words of the refusal
REFUSED = {
    "the text of sar": (
        table(
            "12:00:01 AM  %user  %idle",
            stamps("%I:%M:%S %p"),
            VALUES,
            100 - VALUES,
            separator="  ",
            above="Linux 5.4.0 (host1)\t03/01/2024\t_x86_64_\n\n",
        ),
        "sadf -d",
    ),
    "frames of a CAN bus": (
        "".join(f"({second}.25) can0 1A0#00FF\n" for second in SECONDS),
        "DBC",
    ),
    "vectors in brackets": (
        "# Forces\n" + "".join(f"{value}\t((1 2 3) (4 5 6))\n" for value in VALUES),
        "without brackets",
    ),
    "a page": ("<!DOCTYPE html>\n<table>\n" + table("time,v", UTC, VALUES), "pandas.read_html"),
    "a log of a serial monitor": (
        table("00:00:00.012 -> 20.1", stamps("%H:%M:%S.012"), VALUES, separator=" -> "),
        "a comma instead of ' -> '",
    ),
    "names beside their values": (
        "".join(f"Temp: {value} C\n" for value in VALUES),
        "--no-header",
        {"options": Cleaning(no_header=True)},
        1,
    ),
    "a name and its value in one cell": (
        "".join(f"Temp:{value}C\n" for value in VALUES),
        "only numbers below a line of names",
    ),
    "blanks between columns without names, below two other lines": (
        table("Albuquerque", range(10, 10 + N), VALUES, separator="  ", below="").replace(
            "\n", "\n 35.04 -106.6 1617 version 1\n", 1
        ),
        "--no-header",
        {"options": Cleaning(no_header=True), "time": "column 0"},
        1,
    ),
    "a clock without a name": (
        table("", 250 * np.arange(N), VALUES).removeprefix("\n"),
        "--no-header",
        {"options": Cleaning(no_header=True, time_format="ms"), "time": "column 0"},
        0.25,
    ),
    "a clock that stays": (
        table("time,v", np.arange(N) // 5, VALUES),
        "named like one and does not",
        {"time": "none"},
        1,
    ),
    "years of two digits in front or behind": (
        table("time,v", stamps("%y/%m/%d %H:%M"), VALUES),
        "--time-format '%y/%m/%d %H:%M'",
    ),
    "decimal years": (table("time,v", 2020 + SECONDS / 86_400, VALUES), "decimal years or seconds"),
    "times of day in numbers": (
        table("time,v", [f"12{minute:02d}00" for minute in range(N)], VALUES),
        "times of day or seconds",
    ),
    "microseconds since boot": (
        table("timestamp,v", 623_456_789 + 19_987 * np.arange(N), VALUES),
        "--time-format us",
    ),
    "seconds since 1904": (
        table("time,v", TIMES.as_unit("s").asi8 + 2_082_844_800, VALUES),
        "1980 to 2077",
    ),
    "seconds since 1980": (
        table("gps_time,v", TIMES.as_unit("s").asi8 - 315_964_782, VALUES),
        "--time gps_time",
    ),
    "seconds and nanoseconds": (
        table("sec,nanosec,v", TIMES.as_unit("s").asi8 // 120 * 120, [0, 500] * (N // 2), VALUES),
        "--time sec",
    ),
    "a zone beside the times": (
        table("time,tz_offset,v", MINUTES, ["+02:00"] * N, VALUES),
        "time, tz_offset in",
    ),
    "a zone in the name": (table("Time (CET),v", MINUTES, VALUES), "--timezone"),
    "one date past midnight": (
        table(
            "date,clock,v",
            ["2024-03-01"] * N,
            (TIMES + pd.Timedelta("23.5h")).strftime("%H:%M"),
            VALUES,
        ),
        "one day, as where a date stays past midnight, at line 32",
    ),
    "days or months first": (
        table("time,v", dates("%d/%m/%Y", 31)[:2].repeat(N // 2), VALUES),
        "--time-format %m/%d/%Y",
    ),
    "a date and a time in numbers": (
        table("Date,Time,v", stamps("%Y%m%d"), stamps("%H%M%S"), VALUES),
        "one column",
    ),
    "a zone in letters": (
        table("time,v", stamps("%Y-%m-%d %H:%M CET"), VALUES),
        "offset such as +01:00",
    ),
    "a point where there are commas": (
        table("Zeit;U", stamps("%d.%m.%Y %H:%M"), ["1.234"] * N, separator=";"),
        "'1.234'",
    ),
    "no names": (table("0.0,20.0", SECONDS[1:] + 0.5, VALUES[1:]), "--no-header"),
    "digits that a spreadsheet dropped": (
        table("time,v", ["1.70925E+12"] * N, VALUES),
        "a clock that lost digits",
    ),
    "minutes where there are seconds": (
        table("time,v", ["2024-03-01 00:00", "2024-03-01 00:01"] * 30, VALUES),
        "2 different",
    ),
    "thousands or decimals": (table("time;v", MINUTES, ["1,500"] * N, separator=";"), "--decimal"),
    "points and commas": (
        table("time;v;w", MINUTES, commas(VALUES), VALUES, separator=";"),
        "a point in 'w'",
    ),
    "a short line below the names": (
        table("time,v,w", SECONDS, VALUES, VALUES).replace(f",{VALUES[0]}\n", "\n", 1),
        "line 2 has 2",
    ),
    "names in another order further down": (
        table("time,v,w", SECONDS, VALUES, VALUES, below="time,w,v\n3600,1,2\n"),
        "time, w, v at line 62",
    ),
    "a time of day of an unknown form": (
        table("Date;Heure;T", stamps("%d/%m/2024"), stamps("%Hh%M"), VALUES, separator=";").replace(
            "01/03", "31/03"
        ),
        "one column, as 2024",
    ),
    "a date that stays and a time without a unit": (
        table("date,time,v", ["2024-03-01"] * N, np.arange(N), VALUES),
        "--time time",
    ),
    "hours and minutes in one number": (
        table("Time,v", (TIMES + pd.Timedelta("9h30min")).strftime("%H%M"), VALUES),
        "times of day or seconds",
    ),
    "a finer clock beside dates": (
        table("time_ms,date,v", 500 * np.arange(N), MINUTES.repeat(30)[:N], VALUES),
        "--time time_ms",
    ),
    "another table further down": (
        table("time,v", SECONDS, VALUES, below="time,w\n3600,1\n"),
        "time, w at line 62",
    ),
    "times of day under another name": (table("hms,v", stamps("%H:%M:%S"), VALUES), "with a date"),
    "a multiple of a unit": (
        table("Time [10ms],v", 6_000 * np.arange(N), VALUES),
        "multiple of a unit",
    ),
    "a date and hours and minutes in one number": (
        table(
            "date,time,v", stamps("%Y-%m-%d"), (TIMES + pd.Timedelta("9h")).strftime("%H%M"), VALUES
        ),
        "one column, as 2024",
    ),
    "a clock behind each signal": (
        table("v,v_time,w,w_time", VALUES, SECONDS, VALUES, 2 * SECONDS),
        "--time w_time --column w",
    ),
    "steps of 100 ns since 1601": (
        table("time,v", 133_537_536 * 10**9 + 10**7 * SECONDS, VALUES),
        "from 1601 or 1904",
    ),
    "times since 1970 and no names": (
        table("", 1_709_287_200 + SECONDS, VALUES).removeprefix("\n"),
        "--no-header",
        {"options": Cleaning(no_header=True), "time": "column 0"},
        60.0,
    ),
    "a longer line": (
        table("time,v", MINUTES, VALUES).replace(f",{VALUES[5]}\n", ",1,2,3\n", 1),
        "line 7 has 4",
    ),
    "a cell that is left out between blanks": (
        table("t v w", SECONDS, VALUES, VALUES, separator=" ").replace(f" {VALUES[5]}", "", 1),
        "line 7 has 2",
    ),
    "a clock that begins again": (
        table("time,v", [*range(40), *np.arange(0.5, 20)], VALUES),
        "at line 42",
    ),
    "a sum at the end": (
        table("time,v", UTC, VALUES, below="Average,20.1\n"),
        "'Average' at line 62",
    ),
    "a time of day": (table("time,v", stamps("%H:%M:%S"), VALUES), "column of dates"),
    "another unit behind some numbers": (
        table("time,v", SECONDS, [f"{value} {'V' if value > 16 else 'mV'}" for value in VALUES]),
        f"mV' at line {2 + np.argmax(VALUES <= 16)}",
    ),
    "a number and a flag in one cell": (
        table("time,v", UTC, [f'"{round(100 * value)},{k % 2}"' for k, value in enumerate(VALUES)]),
        "values and flags in columns of their own",
    ),
    "dates of another zone than times since 1970 beside them": (
        table("unix,time,v", 1_709_251_200 + SECONDS, stamps("%Y-%m-%d 10:%M:%S"), VALUES),
        "10 h apart",
        {"time": "unix"},
        60,
    ),
    "microseconds from zero": (
        table("time,v", 2_000 * np.arange(N), VALUES),
        "--time-format us",
        {"options": Cleaning(time_format="us")},
        0.002,
    ),
    "semicolons, decimal commas and no names": (
        table("", SECONDS, commas(VALUES), commas(VALUES), separator=";").strip(),
        "--no-header",
        {"options": Cleaning(no_header=True), "time": "column 0", "columns": ["column 2"]},
        60,
    ),
    "fewer names than values": (
        table("time\tv (V)", SECONDS, VALUES, VALUES, separator="\t"),
        "2 names",
    ),
    "no names above values that count": (
        table("@0:00,1,2", stamps("@%H:%M"), [1] * N, [2] * N),
        "--no-header",
    ),
    "a zone in letters in another column": (
        table("gps,device,v", stamps("%a %b %d %H:%M:%S PDT %Y"), MINUTES, VALUES),
        "PDT 2024",
        {"options": Cleaning(timezone="UTC")},
        60,
    ),
    "two tables": (
        table("time,a,b", UTC, VALUES, VALUES, below=table("time,v", UTC, VALUES)),
        f"--skip-rows {N + 1}",
        {"options": Cleaning(skip_rows=N + 1)},
        60,
    ),
    "three rows of another table": (
        table("time,a,b", UTC[:3], VALUES[:3], VALUES[:3], below=table("time,v", UTC, VALUES)),
        "--skip-rows 4",
        {"options": Cleaning(skip_rows=4)},
        60,
    ),
    "numbered places one after the other": (
        table("location_id,time,v", [0] * N, UTC, VALUES)
        + table("location_id,time,v", [1] * N, UTC, VALUES).partition("\n")[2],
        "--series-column location_id",
    ),
    "a zone beside the table": (
        table("time,v", MINUTES, VALUES, above="zone\nEurope/Berlin\n\n"),
        "--timezone Europe/Berlin",
        {"options": Cleaning(timezone="Europe/Berlin")},
        60,
    ),
    "a clock before each signal, behind a column of marks": (
        table("mark,TIME,v,TIME,w", ["x"] * N, SECONDS, VALUES, SECONDS + 40, VALUES),
        "--time TIME.2 --column w",
        {"time": "TIME.1", "columns": ["v"]},
        60,
    ),
    "an index without a name that varies": (
        table(",v", SECONDS + 20 * np.sin(np.arange(N)).round(2), VALUES),
        "--time 'column 0'",
    ),
    "equal names": (table("time,v,v", SECONDS, VALUES, VALUES), "v.1, v.2"),
    "numbered sensors": (
        table("time,sensor_id,v", UTC.repeat(2), [7, 8] * N, 0.5 * np.arange(2 * N)),
        "--series-column sensor_id",
    ),
}


@pytest.mark.parametrize("form", [*ASKED, *REFUSED])
def test_a_form_with_two_meanings_is_refused_and_read_as_the_message_says(tmp_path, refused, form):
    text, words, *how = (ASKED | REFUSED)[form]
    (tmp_path / "a.csv").write_text(text)
    with refused(words):
        for series in read_source(tmp_path / "a.csv").values():
            clean(series)
    if how:
        arguments, interval_s = how
        cleaned = clean(only(read_source(tmp_path / "a.csv", **arguments)))
        assert cleaned.longest.interval_s == pytest.approx(interval_s)
        np.testing.assert_allclose(cleaned.longest.values[:, 0], VALUES, atol=1e-5)


@pytest.mark.parametrize(
    ("header", "form", "values"),
    [
        ("Year,Month,Day,Mean,Min,Max", "%Y,%m,%d", ([8, 9, 7], [3, 5, 2], [14, 15, 12])),
        ("Year,Month,Day,mm,b,c", "%Y,%m,%d", ([3, 5, 2], [8, 9, 7], [1, 2, 1])),
        ("time,ms,b,c", "%Y-%m-%dT00:00:00", ([23, 950, 480], [8, 9, 7], [1, 2, 1])),
        ("time,ns,b,c", "%Y-%m-%dT00:00:00", ([5, 7, 6], [8, 9, 7], [1, 2, 1])),
    ],
)
def test_what_is_named_like_a_part_of_a_time_but_is_none_is_a_channel(
    tmp_path, header, form, values
):
    dates = pd.date_range("2024-03-01", periods=12, freq="D").strftime(form)
    if "time" in header:
        dates = pd.date_range("2024-03-01", periods=12, freq="s").strftime("%Y-%m-%dT%H:%M:%S")
    (tmp_path / "a.csv").write_text(table(header, dates, *(4 * each for each in values)))
    channels = read_source(tmp_path / "a.csv")
    assert list(channels) == header.split(",")[-3:]
    interval_s = 1 if "time" in header else 86_400
    assert clean(channels[header.split(",")[-3]]).telemetry.interval_s == interval_s


@pytest.mark.parametrize("part", ["second", "hour"])
def test_a_part_of_a_time_that_is_out_of_range_loses_its_row_alone(part):
    frame = pd.DataFrame(
        {"year": 2024, "month": 3, "day": 1, "hour": TIMES.hour, "minute": TIMES.minute}
    ).assign(second=0, v=VALUES)
    frame.loc[30, part] = 99
    cleaned = clean(only(read_source(frame)))
    assert cleaned.report.find("missing times").count == 1
    np.testing.assert_allclose(
        np.delete(cleaned.telemetry.values[:, 0], 30), np.delete(VALUES, 30), atol=1e-5
    )


def test_a_damaged_time_of_day_makes_no_elapsed_times(tmp_path, refused):
    cells = [*stamps("%H:%M:%S")[:30], "99:59:59", *stamps("%H:%M:%S")[31:]]
    (tmp_path / "a.csv").write_text(table("date,clock,v", stamps("%Y-%m-%d"), cells, VALUES))
    with refused("'2024-03-01 99:59:59' at line 32", "--drop-bad"):
        read_source(tmp_path / "a.csv")


def test_keys_that_look_like_hours_tell_series_apart():
    frame = pd.DataFrame({"date": TIMES.strftime("%Y-%m-%d"), "age": ["18-24", "25-34"] * 30})
    frame["date"] = pd.date_range("2024", periods=30).repeat(2).strftime("%Y-%m-%d")
    assert list(read_source(frame.assign(v=VALUES))) == ["18-24", "25-34"]


def test_lines_that_repeat_the_names_leave_no_gap(tmp_path):
    (tmp_path / "a.csv").write_text("a,b\n1.5,2\n2.5,x\na,b\n4.5,5\n5.5,y\n")
    channels = read_source(tmp_path / "a.csv")
    assert clean(channels["a"]).telemetry.values[:, 0].tolist() == [1.5, 2.5, 4.5, 5.5]
    assert [channels["b"].places.of(row) for row in (1, 3)] == ["line 3", "line 6"]


def test_numbers_that_turn_hexadecimal_further_down_are_words(tmp_path, refused):
    cells = [f"{number:02X}" for number in [*range(16, 26)] * 30 + [*range(160, 256)]]
    (tmp_path / "a.csv").write_text(table("time,code,v", range(396), cells, range(396)))
    assert list(read_source(tmp_path / "a.csv")) == ["v"]
    (tmp_path / "a.csv").write_text(
        table("time,code,v", range(301), [*cells[:300], "5A"], range(301))
    )
    with refused("'5A' at line 302"):
        clean(read_source(tmp_path / "a.csv")["code"])


def test_a_column_without_a_name_that_does_not_count_by_one_may_be_the_clock(tmp_path, refused):
    (tmp_path / "a.csv").write_text(table("", 250 * np.arange(N), VALUES).removeprefix("\n"))
    with refused("--time 'column 0' --time-format ms"):
        read_source(tmp_path / "a.csv", options=Cleaning(no_header=True))


def test_samples_that_are_counted_are_not_said_to_need_an_interval():
    with pytest.raises(InputError, match="at least 2 in a row") as refused:
        clean(pd.Series([1.0, *[np.nan] * 9, 2.0, *[np.nan] * 9]))
    assert refused.value.options == ({"max_fill": 50},)


def test_a_number_and_its_quality_in_one_cell_are_no_decimal(tmp_path):
    (tmp_path / "a.csv").write_text(table("time,air,v", MINUTES, ['"+0200,1"'] * N, VALUES))
    series = only(read_source(tmp_path / "a.csv"))
    check(series)
    assert series.name == "v"


def test_units_that_change_from_row_to_row_tell_series_apart():
    channels = read_source(
        pd.DataFrame({"time": TIMES, "v": VALUES, "unit": np.where(np.arange(N) < 30, "V", "mV")})
    )
    check(channels["V"], VALUES[:30])
    check(channels["mV"], VALUES[30:], TIMES[30])


def test_a_column_that_does_not_increase_is_no_clock(tmp_path):
    (tmp_path / "a.csv").write_text(table("T,p", VALUES, VALUES**2))
    channels = read_source(tmp_path / "a.csv")
    assert (
        list(channels) == ["T", "p"]
        and check(channels["T"], start=None, interval_s=1.0).find("clock").details["column"] is None
    )


@pytest.mark.parametrize("offset", ["+05", "+0530", "+05:30", "Z"])
def test_a_stated_offset_goes_before_the_option(tmp_path, offset):
    (tmp_path / "a.csv").write_text(table("time,v", stamps(f"%Y-%m-%d %H:%M:%S{offset}"), VALUES))
    hours = {"+05": 5, "Z": 0}.get(offset, 5.5)
    for zone in ("Asia/Tokyo", None):
        report = check(
            only(read_source(tmp_path / "a.csv")),
            start=START - pd.Timedelta(hours=hours),
            options=Cleaning(timezone=zone),
        )
        clock = report.find("clock").text
        assert "stated" in clock and ("goes before Asia/Tokyo" in clock) == (zone is not None)


def test_a_year_at_the_end_is_no_offset(tmp_path):
    (tmp_path / "a.csv").write_text(table("time,v", stamps("%H:%M:%S %d-%m-%Y"), VALUES))
    options = Cleaning(time_format="%H:%M:%S %d-%m-%Y", timezone="America/New_York")
    check(
        only(read_source(tmp_path / "a.csv", options=options)),
        start=START + pd.Timedelta(hours=5),
        options=options,
    )


@pytest.mark.parametrize("shift_s", [0, 7])
@pytest.mark.parametrize("begin", ["2024-10-26T22:00Z", "2024-10-27T00:10Z"])
def test_an_hour_that_a_clock_repeats_is_two_hours(tmp_path, begin, shift_s):
    utc = pd.date_range(begin, periods=200, freq="10min") + pd.to_timedelta(
        shift_s * (np.arange(200) % 2), unit="s"
    )
    (tmp_path / "a.csv").write_text(
        table(
            "time,v",
            utc.tz_convert("Europe/Berlin").strftime("%Y-%m-%d %H:%M:%S"),
            np.arange(200) % 7,
        )
    )
    options = Cleaning(timezone="Europe/Berlin")
    cleaned = clean(only(read_source(tmp_path / "a.csv", options=options)), options)
    assert (cleaned.report.rows_used, len(cleaned.parts)) == (200, 1)
    assert abs(pd.Timestamp(cleaned.parts[0].start) - utc[0]) < pd.Timedelta("10s")


def long(**keys):
    """Two series at the same times, told apart by columns of words; the second is 9 higher."""
    frame = pd.DataFrame(
        {"time": TIMES.repeat(2), **{name: list(words) * N for name, words in keys.items()}}
    )
    return frame.assign(v=VALUES.repeat(2) + np.tile([0, 9], N))


SERIES = {
    "rows in turn": long(host=("a", "b")),
    "one after the other": long(host=("a", "b")).sort_values("host", kind="stable"),
    "a column of another name": long(which=("a", "b")),
    "two columns that say the same": long(sensor=("a", "b"), place=("north", "south")),
    "other times": long(host=("a", "b")).assign(
        time=TIMES.repeat(2) + pd.to_timedelta(np.tile([0, 30], N), unit="s")
    ),
}


@pytest.mark.parametrize("form", SERIES)
def test_several_series_in_one_table_are_told_apart(tmp_path, form):
    SERIES[form].to_csv(tmp_path / "a.csv", index=False)
    channels = read_source(tmp_path / "a.csv")
    assert list(channels) == ["a", "b"]
    check(channels["a"])
    report = check(
        channels["b"], VALUES + 9, START + pd.Timedelta("30s" if form == "other times" else "0s")
    )
    assert report.find("series").count == 2


def test_a_named_column_of_several_series_is_told_apart_too():
    frame = long(host=("a", "b")).assign(other=2.0)
    assert list(read_source(frame, ["v"])) == ["a", "b"]
    assert list(read_source(frame, ["a.v"])) == ["a.v"] and len(read_source(frame)) == 4


def test_a_state_is_no_key_of_series():
    check(
        only(
            read_source(
                pd.DataFrame(
                    {
                        "time": TIMES,
                        "mode": np.where(np.arange(N) % 20 < 10, "sun", "eclipse"),
                        "v": VALUES,
                    }
                )
            )
        )
    )


def test_a_blank_line_at_the_end_of_several_series_is_none_of_them(tmp_path):
    rows = [
        f",_result,{number},{time},{value},{field}"
        for number, field in enumerate(("amps", "volts"))
        for time, value in zip(TIMES.strftime("%Y-%m-%dT%H:%M:%SZ"), VALUES + number, strict=True)
    ]
    (tmp_path / "export.csv").write_text(
        "\r\n".join([",result,table,_time,_value,_field", *rows]) + "\r\n\r\n"
    )
    channels = read_source(tmp_path / "export.csv")
    assert list(channels) == ["amps", "volts"]
    assert [series.cells.to_list() for series in channels.values()] == [
        VALUES.tolist(),
        (VALUES + 1).tolist(),
    ]


def test_the_columns_of_series_and_values_can_be_named():
    frame, options = long(number=(7, 8)).assign(other=1.0), Cleaning(series_column="number")
    channels = read_source(frame, ["v"], options=options)
    assert list(channels) == ["7", "8"] and list(read_source(frame, ["8.v"], options=options)) == [
        "8.v"
    ]
    check(channels["8"], VALUES + 9)


def annotated(field, values, result="_result"):
    head = f"#group,false,false,true,false,true\n#datatype,string,long,dateTime:RFC3339,double,string\n#default,{result},,,,\n"
    rows = [
        f",,0,{time:%Y-%m-%dT%H:%M:%SZ},{value},{field}"
        for time, value in zip(TIMES, values, strict=True)
    ]
    return head + ",result,table,_time,_value,_field\n" + "\n".join(rows) + "\n\n"


def test_tables_of_annotated_csv_are_series(tmp_path):
    (tmp_path / "a.csv").write_text(annotated("volts", VALUES) + annotated("amps", 2 * VALUES))
    channels = read_source(tmp_path / "a.csv")
    assert list(channels) == ["volts", "amps"]
    check(channels["volts"])
    check(channels["amps"], 2 * VALUES)
    # 3 annotations, names, 60 rows, a blank line, and 4 more
    assert channels["amps"].places.of(0) == "line 70"
    (tmp_path / "b.csv").write_text(
        annotated("volts", VALUES, "mean") + annotated("volts", 2 * VALUES, "max")
    )
    assert list(read_source(tmp_path / "b.csv")) == ["mean", "max"]


LABELS = {
    "zeros and ones": (np.arange(N) % 20 == 3).astype(int),
    "true and false": np.arange(N) % 20 == 3,
    "words": np.where(np.arange(N) % 20 == 3, "Attack", "Normal"),
    "minus one": np.where(np.arange(N) % 20 == 3, -1, 1),
}


@pytest.mark.parametrize("form", LABELS)
@pytest.mark.parametrize("name", ["is_anomaly", "label", "Normal/Attack"])
def test_labels_are_no_channel_and_mark_rows(name, form):
    frame = pd.DataFrame({"timestamp": TIMES, "v": VALUES, name: LABELS[form]})
    kept = check(only(read_source(frame)))
    assert kept.find("labels").count == 3 and f"'{name}'" in kept.find("labels").text
    missing = clean(only(read_source(frame, options=Cleaning(labelled="missing")))).report
    assert (missing.find("missing values").rows_left_out, missing.samples) == (3, N)


BY_HAND = [
    ([0, 1, 2], [0, 1, 1]),
    ([0, np.nan, 1], [0, 0, 1]),
    ([1, 1], [1, 1]),
    ([-1, 1, np.nan], [1, 0, 0]),
    ([2, 3], None),
]
BY_HAND += [
    ([np.nan, np.nan], [0, 0]),
    (["normal", "attack", None], [0, 1, 0]),
    (["attack", None], [1, 0]),
    (["high", "low"], None),
]


@pytest.mark.parametrize(("cells", "expected"), BY_HAND)
def test_what_a_label_says_by_hand(cells, expected):
    found = anomalous(pd.Series(cells))
    assert (found if found is None else found.tolist()) == expected


def test_a_label_may_be_named_or_refused_and_may_concern_one_channel():
    marks = LABELS["zeros and ones"]
    frame = pd.DataFrame(
        {"time": TIMES, "ch1": VALUES, "ch2": -VALUES, "is_anomaly_ch1": marks, "state": marks}
    )
    channels = read_source(frame, ["ch1", "ch2"])
    assert [clean(series).report.find("labels") is None for series in channels.values()] == [
        False,
        True,
    ]
    named = read_source(frame, options=Cleaning(label_column="state"))
    assert (
        list(named) == ["ch1", "ch2", "is_anomaly_ch1"]
        and clean(named["ch2"]).report.find("labels").count == 3
    )
    assert "state" in read_source(frame, options=Cleaning(label_column="none"))


def test_quality_flags_and_counts_beside_a_clock_are_named_and_left_out():
    report = check(
        only(
            read_source(
                pd.DataFrame({"time": TIMES, "v": VALUES, "v_quality": 192, "number": range(N)})
            )
        )
    )
    assert (
        "v_quality" in report.find("quality flags").text
        and "number" in report.find("row numbers").text
    )


@pytest.mark.parametrize("fill", [9999.0, -999.9, 1e20])
def test_fill_values_are_reported_and_left_out_when_named(fill):
    series = pd.Series(np.where(np.arange(N) % 20 == 5, fill, VALUES), index=TIMES)
    found = clean(series).report.find("fill values")
    assert found.details["values"] == [fill] and "--missing-values" in found.text
    cleaned = clean(series, Cleaning(missing_values=[fill]))
    assert cleaned.report.rows_left_out == 3 and cleaned.parts[0].values[:, 0].max() < 26


@pytest.mark.parametrize(("others", "is_found"), [(10, True), (9, False)])
def test_a_value_without_usual_digits_is_a_fill_value_beside_at_least_ten_others(others, is_found):
    values = np.where(np.arange(N) % 20 == 5, 100.0, np.arange(N) % others)
    assert (
        clean(pd.Series(values, index=TIMES)).report.find("fill values") is not None
    ) == is_found


@pytest.mark.parametrize(
    "values",
    [
        VALUES,
        np.where(np.arange(N) % 20 == 5, 100.0, 0.0),
        np.where(np.arange(N) == 5, 9999.0, VALUES),
    ],
)
def test_states_and_single_spikes_are_no_fill_values(values):
    assert clean(pd.Series(values, index=TIMES)).report.find("fill values") is None


def test_one_decimal_sign_holds_for_all_columns(tmp_path):
    watts = 950 + np.arange(N)
    written = [f"{watt // 1000}.{watt % 1000:03d}" if watt >= 1000 else str(watt) for watt in watts]
    (tmp_path / "a.csv").write_text(
        table("time;watts;celsius", MINUTES, written, commas(VALUES), separator=";")
    )
    channels = read_source(tmp_path / "a.csv")
    check(channels["watts"], watts)
    check(channels["celsius"])
    shown = [
        f'"{watt // 1000},{watt % 1000:03d}.5"' if watt >= 1000 else f"{watt}.5" for watt in watts
    ]
    (tmp_path / "b.csv").write_text(table("time,watts", MINUTES, shown))
    check(only(read_source(tmp_path / "b.csv")), watts + 0.5)


def test_steps_are_measured_before_gaps_are_filled():
    values = pd.Series(
        np.tile(VALUES.round(1), 20), index=pd.date_range(START, periods=20 * N, freq="s")
    )
    values = values.drop(values.index[: 60 * 20 : 20])
    assert clean(values).report.find("quantised").details["step"] == pytest.approx(0.1)


PLAIN = table("time,v", UTC, VALUES)


def days(folder):
    lines = PLAIN.splitlines(keepends=True)
    for name, part in (
        ("day1.csv", lines[1:31]),
        ("day2.csv", lines[31:50]),
        ("day10.csv", lines[50:]),
    ):
        (folder / name).write_text("".join([lines[0], *part]))
    return folder


def test_files_of_several_days_are_one_table(tmp_path, refused):
    (tmp_path / "days").mkdir()
    folder = days(tmp_path / "days")
    (folder / "notes.txt").write_text("not read")
    report = check(only(read_source(folder)))
    assert "day1.csv to day10.csv" in report.find("files").text
    series = only(read_source([folder / "day1.csv", folder / "day2.csv", folder / "day10.csv"]))
    assert series.places.of(30) == "line 2 of day2.csv"
    (folder / "day2.csv").write_text("time,w\n2024-03-02,1\n")
    with refused("'v' not exactly once in day1.csv and day2.csv"):
        read_source(folder)


def test_packed_files_are_read(tmp_path, refused):
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(PLAIN.encode()))
    check(only(read_source(tmp_path / "a.csv.gz")))
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("inside.CSV", PLAIN)
    check(only(read_source(tmp_path / "a.zip")))
    with zipfile.ZipFile(tmp_path / "a.zip", "a") as archive:
        archive.writestr("second.csv", PLAIN)
    with refused("inside.CSV, second.csv"):
        read_source(tmp_path / "a.zip")


def test_a_workbook_is_read_with_its_dates(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (
        ["Station 7"],
        [],
        ["Zeit", "Spannung"],
        *zip(TIMES.tz_localize(None), VALUES, strict=True),
    ):
        book.active.append(list(row))
    book.save(tmp_path / "a.xlsx")
    series = only(read_source(tmp_path / "a.xlsx"))
    check(series)
    assert (series.name, series.places.of(0)) == ("Spannung", "line 4")


def test_a_workbook_whose_first_sheet_has_no_numbers_says_which_sheet_was_read(tmp_path, refused):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for cell, sheet in (("by hand", book.active), (1.5, book.create_sheet())):
        sheet.append(["v"])
        sheet.append([cell])
    book.save(tmp_path / "a.xlsx")
    with refused("only the first sheet was read: Sheet"):
        read_source(tmp_path / "a.xlsx")


def test_pandas_objects_are_sources():
    frame = pd.DataFrame({"time": TIMES, "v": VALUES})
    check(only(read_source(frame)))
    check(only(read_source(frame.set_index("time")["v"])))
    parts = frame.assign(year=2024, month=3, day=1, second=SECONDS)[
        ["year", "month", "day", "second", "v"]
    ]
    check(only(read_source(parts.iloc[5:])), VALUES[5:], TIMES[5])


@pytest.mark.parametrize("form", ["labelled.csv", "labelled.parquet", "timeeval.csv"])
def test_the_files_of_this_tool_are_read_back(tmp_path, form):
    cleaned = clean(pd.Series(VALUES, index=TIMES, name="value"))
    frame = inject(cleaned.parts, InjectOptions(at=("level_shift:4@20/10",), noise_sd=1.0)).table
    write_table(tmp_path / form, frame, ["value"] if form == "timeeval.csv" else ())
    series = only(read_source(tmp_path / form))
    report = check(series, frame["value"])
    assert series.name == "value" and report.find("labels").count == 10


def test_scores_of_this_tool_are_no_channels():
    frame = pd.DataFrame(
        {
            "time": TIMES,
            "value": VALUES,
            "score": VALUES / 30,
            "flag": VALUES > 24,
            "score_after": VALUES / 40,
        }
    )
    assert list(read_source(frame)) == ["value"]


def test_copies_of_a_run_are_series():
    frame = (
        long(copy=(0, 1))
        .rename(columns={"v": "value"})
        .assign(out_of_range=0.5, scenario="worn", severity=0.5, mask=1)
    )
    channels = read_source(frame)
    assert list(channels) == ["copy 0", "copy 1"]
    check(channels["copy 1"], VALUES + 9)


def test_names_may_be_missing(tmp_path):
    (tmp_path / "a.txt").write_text("\n".join(f"  {value:.7e}" for value in VALUES))
    series = only(read_source(tmp_path / "a.txt", options=Cleaning(no_header=True)))
    check(series, start=None, interval_s=1.0)
    assert series.name == "column 0"


def test_whole_and_fractional_seconds_are_read_in_one_column(tmp_path):
    times = [
        time.strftime("%d.%m.%Y %H:%M:%S") + ("" if row % 2 else ",250")
        for row, time in enumerate(TIMES)
    ]
    (tmp_path / "a.csv").write_text(table("time;v", times, VALUES, separator=";"))
    index = only(read_source(tmp_path / "a.csv")).times.stamps
    assert (index[0] - START.tz_localize(None), index[1] - index[0]) == (
        pd.Timedelta("250ms"),
        pd.Timedelta("59.75s"),
    )


def test_a_year_and_a_month_are_the_first_day_of_the_month():
    frame = pd.DataFrame(
        {"year": 1990 + np.arange(N) // 12, "month": 1 + np.arange(N) % 12, "v": VALUES}
    )
    assert only(read_source(frame)).times.stamps[-1] == pd.Timestamp("1994-12-01")


def test_files_over_the_same_times_are_no_parts_of_one_series(tmp_path, refused):
    (tmp_path / "volts.csv").write_text(PLAIN)
    (tmp_path / "amps.csv").write_text("".join(PLAIN.splitlines(keepends=True)[:20]))
    with refused("amps.csv and volts.csv over the same times"):
        read_source(tmp_path)


def test_few_different_numbers_with_one_unit_are_numbers():
    parsed, bad, _ = parse_numbers(["960.5 hPa", "961.0 hPa"], "")
    assert parsed.tolist() == [960.5, 961] and not bad.any()


def test_a_blank_last_line_leaves_row_numbers_what_they_are(tmp_path):
    (tmp_path / "a.csv").write_text(
        table("time,id,v", UTC, range(11, 11 + N), VALUES, below=",,\n")
    )
    assert list(read_source(tmp_path / "a.csv")) == ["v"]


def test_a_channel_that_cannot_be_read_leaves_the_others_as_an_option(tmp_path, refused):
    sparse = ["" if k not in (3, 40) else 5 for k in range(N)]
    (tmp_path / "a.csv").write_text(table("time,v,w", UTC, VALUES, sparse))
    with refused("--column v"):
        read_telemetry(tmp_path / "a.csv", Cleaning(min_part=3))
    (telemetry,) = read_telemetry(tmp_path / "a.csv", Cleaning(min_part=3), ["v"])
    assert len(telemetry) == N


HALVES = [f'"{20 + k % 3},{5 * (k % 2)}"' for k in range(N)]
# form: text, its channels
ORDINARY = {
    "a line above the names": (table("time,v", UTC, VALUES, above="Rate,100\n"), ["v"]),
    "numbers of channels above the names": (
        table(
            "time,v,w,x",
            UTC,
            *[VALUES] * 3,
            above="Probe,Gain,Offset\n" + "".join(f"p{k},1,{k}\n" for k in range(3)),
        ),
        ["v", "w", "x"],
    ),
    "quotes above the names and a gap in the last column": (
        table("time,v,w", UTC, VALUES, VALUES, above='5" tube\n').replace(
            f",{VALUES[7]},{VALUES[7]}\n", f",{VALUES[7]},\n"
        ),
        ["v", "w"],
    ),
    "depths that tell series apart": (
        table("time,depth,v", UTC.repeat(2), ["10 cm", "20 cm"] * N, range(2 * N)),
        ["10 cm", "20 cm"],
    ),
    "numbers with two colons": (
        table("date,port,v", stamps("%Y-%m-%d %H:%M"), [f"0:1:{k % 7}" for k in range(N)], VALUES),
        ["v"],
    ),
    "decimals in steps of a half": (
        table("time,v,w", UTC, HALVES, [f'"{v}"' for v in commas(VALUES)]),
        ["v", "w"],
    ),
    "a sentence with a comma above blanks": (
        table("t v", commas(SECONDS + 0.5), commas(VALUES), separator=" ", above="Hall, 2\n"),
        ["v"],
    ),
    "names with decimal commas around": (
        table("time, s\tv, V", SECONDS, commas(VALUES), separator="\t"),
        ["v, V"],
    ),
    "a place beside times in UTC": (
        table("time (UTC),v", MINUTES, VALUES, above="# at Europe/Berlin\n"),
        ["v"],
    ),
    "ends of intervals since 1970": (
        table("open_time,close_time,v", UTC, 1_709_254_799 + SECONDS, VALUES),
        ["v"],
    ),
    "limits of channels above the names": (
        table("time,v", UTC, VALUES, above="".join(f"c{k},-10,10\n" for k in range(12))),
        ["v"],
    ),
}


@pytest.mark.parametrize("form", ORDINARY)
def test_an_ordinary_form_is_taken_for_no_odd_one(tmp_path, form):
    text, names = ORDINARY[form]
    (tmp_path / "a.csv").write_text(text)
    assert list(read_source(tmp_path / "a.csv")) == names


@pytest.mark.parametrize("text", ["time,v", "time v", '"time"'])
def test_names_without_an_end_are_no_table(tmp_path, refused, text):
    (tmp_path / "a.csv").write_text(text)
    with refused("rows below the header"):
        read_source(tmp_path / "a.csv")


def test_the_hour_goes_before_that_in_which_an_interval_ends():
    times = pd.date_range(START, periods=N, freq="h")
    frame = {"date": times.strftime("%Y-%m-%d"), "Hour Ending": times.hour + 1, "hour": times.hour}
    channels = read_source(pd.DataFrame(frame | {"v": VALUES}))
    assert clean(channels["v"]).telemetry.start == "2024-03-01T00:00:00+00:00"


def test_a_clock_that_begins_again_leaves_no_channel_as_an_option():
    frame = pd.DataFrame({"t": [*range(N), *range(N)], "v": [*VALUES, *-VALUES], "w": 1.0})
    with pytest.raises(InputError, match="begin again") as caught:
        read_telemetry(frame)
    assert caught.value.options == ({"time": "none"},)


def test_words_that_repeat_times_are_states_on_request(refused):
    frame = pd.DataFrame({"time": TIMES.repeat(2), "a": ["on", "off"] * N, "b": ["x", "y"] * N})
    with refused("--states --series-column none"):
        read_source(frame)
    assert set(read_source(frame, options=Cleaning(states=True, series_column="none"))) == {
        "a",
        "b",
    }


def test_tables_in_csv_and_parquet_are_no_parts_of_one_series(tmp_path, refused):
    (tmp_path / "a.csv").write_text(PLAIN)
    pd.read_csv(tmp_path / "a.csv").to_parquet(tmp_path / "b.parquet")
    with refused("a.csv and b.parquet"):
        read_source(tmp_path)


def test_series_of_words_beside_series_of_numbers_are_left_out():
    frame = pd.DataFrame({"id": ["a", "b"] * N, "time": TIMES.repeat(2)})
    frame["value"] = [word for value in VALUES for word in (str(value), "on")]
    channels = read_source(frame)
    assert list(channels) == ["a"]
    assert "series without numbers: b" in check(channels["a"]).find("columns left out").text


def test_hours_that_end_are_those_of_a_day_beside_its_date(tmp_path):
    times = pd.date_range(START, periods=N, freq="h")
    ends = [times.strftime("%Y-%m-%d"), times.hour + 1]
    (tmp_path / "a.csv").write_text(table("Date,Hour Ending,v", *ends, VALUES))
    check(only(read_source(tmp_path / "a.csv")), start=START + pd.Timedelta("1h"), interval_s=3600)


def test_names_may_be_numbers_behind_that_of_the_clock(tmp_path):
    (tmp_path / "a.csv").write_text(table("time,31.5,63", UTC, VALUES, 2 * VALUES))
    channels = read_source(tmp_path / "a.csv")
    assert list(channels) == ["31.5", "63"]
    check(channels["63"], 2 * VALUES)


def test_rows_without_the_word_of_others_are_a_series():
    check(read_source(long(host=("a", None)))["a"])


# from 1979 (3.1e8 s) to 2077 (3.4e9 s); 6.4e17 are steps of 100 ns since the year 1
@pytest.mark.parametrize(
    ("size", "unit"),
    [
        (3.1e8, "s"),
        (3.0e8, None),
        (3.4e9, "s"),
        (3.5e9, None),
        (3.1e11, "ms"),
        (3.4e15, "us"),
        (3.1e17, "ns"),
        (6.4e17, None),
        (4.3e18, None),
    ],
)
def test_the_size_of_a_number_says_the_unit_of_a_time_since_1970(size, unit):
    assert epoch_unit(size) == unit


def test_rows_that_were_chosen_from_a_frame_are_no_channel():
    frame = pd.DataFrame({"time": TIMES, "v": VALUES})
    assert list(read_source(frame[frame["v"] > 16])) == ["v"]


def test_parts_of_the_time_beside_it_are_no_channels():
    times = pd.date_range(START, periods=N, freq="h")
    frame = {"time": times, "DOY": times.day_of_year, "Hour": times.hour, "mm": VALUES, "v": VALUES}
    assert list(read_source(pd.DataFrame(frame))) == ["mm", "v"]


def test_a_clock_with_steps_of_any_length_is_asked_for_where_no_column_has_a_name(
    tmp_path, refused
):
    times = (SECONDS + 20 * np.sin(np.arange(N))).round(2)
    (tmp_path / "a.csv").write_text(table("", times, VALUES).lstrip())
    with refused("--time 'column 0'"):
        read_source(tmp_path / "a.csv", options=Cleaning(no_header=True))


def test_hexadecimal_numbers_leave_other_columns_without_names_what_they_are(tmp_path):
    text = table("", SECONDS, [f"DD{k:04X}" for k in range(N)], VALUES)
    (tmp_path / "a.csv").write_text(text.lstrip())
    options = Cleaning(no_header=True)
    assert list(read_source(tmp_path / "a.csv", time="column 0", options=options)) == ["column 2"]


def test_times_since_1970_and_since_the_start_are_one_clock():
    frame = {"timestamp": 1.7e9 + SECONDS, "lap": VALUES, "elapsed_time": SECONDS, "v": -VALUES}
    assert list(read_source(pd.DataFrame(frame))) == ["lap", "v"]


def test_whole_numbers_that_differ_are_a_channel_where_no_column_has_a_name(tmp_path):
    numbers = np.random.default_rng(0).permutation(1_000)[:N]
    (tmp_path / "a.csv").write_text(table("", numbers, VALUES).lstrip())
    channels = read_source(tmp_path / "a.csv", options=Cleaning(no_header=True))
    assert list(channels) == ["column 0", "column 1"]


def test_a_note_says_how_states_beside_channels_are_read():
    frame = pd.DataFrame({"time": TIMES, "v": VALUES, "valve": ["open"] * 20 + ["closed"] * 40})
    assert "--states" in clean(only(read_source(frame))).report.find("columns left out").text


def test_an_option_that_is_too_long_for_a_message_is_none(refused):
    names = [f"a channel with a long name {number}" for number in range(10)]
    frame = pd.DataFrame({name: VALUES for name in names}).assign(time=TIMES)
    with refused("or other names") as found:
        read_source(pd.concat([frame, frame[names[:1]]], axis=1))
    assert found.value.options == tuple({"columns": [f"{names[0]}.{k}"]} for k in (1, 2))


def test_an_index_may_be_named_like_a_column():
    frame = pd.DataFrame({"time": TIMES, "v": VALUES}).set_index("time", drop=False)
    assert list(read_source(frame)) == list(read_source(frame, time="time.1")) == ["v"]


def test_a_short_row_below_no_header_moves_no_value(tmp_path, refused):
    rows = table("", SECONDS, VALUES, VALUES).strip().splitlines()
    rows[20] = rows[20].rpartition(",")[0]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    with refused("line 21"):
        read_source(tmp_path / "a.csv", options=Cleaning(no_header=True))
