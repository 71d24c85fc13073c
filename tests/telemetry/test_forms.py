"""Tables in the forms that people have: each is read with the right times and values, or refused in
one line that says what to do.
"""

import shlex
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
from tests.telemetry.robot import follow

N = 60
ROWS = np.arange(N)
VALUES = (20 + 5 * np.sin(ROWS / 5)).round(2)
START = pd.Timestamp("2024-03-01T00:00:00Z")
ZERO = pd.Timestamp(0, tz="UTC")
TIMES = pd.date_range(START, periods=N, freq="min")
HOURS = pd.date_range(START, periods=N, freq="h")
SECONDS = 60 * ROWS
UNIX = TIMES.as_unit("s").asi8
NIGHT = TIMES + pd.Timedelta("23h30min")  # over midnight


def table(names, *columns, separator=",", below=""):
    """The text of a table: lines down to that of the names, if there are any, the rows, and lines
    below.
    """
    rows = [separator.join(map(str, cells)) for cells in zip(*columns, strict=True)]
    return "\n".join([names, *rows] if names else rows) + "\n" + below


def stamps(form):
    return TIMES.strftime(form)


def timed(names, times, separator=",", values=VALUES):
    """A table whose rows begin with times: those of `TIMES` in a form, which may have several
    cells, or given ones.
    """
    cells = stamps(times) if isinstance(times, str) else times
    return table(names, cells, values, separator=separator)


def framed(**columns):
    """A frame of the times and the values with further columns."""
    return pd.DataFrame({"time": TIMES, "v": VALUES} | columns)


def commas(values):
    return [str(value).replace(".", ",") for value in values]


def one(source, **how):
    """The only channel of a source."""
    (series,) = read_source(source, **how).values()
    return series


def check(series, values=VALUES, start=START, interval_s=60.0, options=None):
    """Checks that a channel is one part with the expected times and values; returns its report."""
    cleaned = clean(series, options)
    (part,) = cleaned.parts
    assert part.interval_s == pytest.approx(interval_s, rel=1e-6)
    if start is None:
        assert part.start is None
    else:
        assert abs(pd.Timestamp(part.start) - pd.Timestamp(start)) <= pd.Timedelta("2ms")
    np.testing.assert_allclose(part.values[:, 0], values, atol=1e-5)
    return cleaned.report


DAYS, CLOCK, MINUTES = stamps("%Y-%m-%d"), stamps("%H:%M:%S"), stamps("%Y-%m-%d %H:%M")
ISO = "%Y-%m-%dT%H:%M:%SZ"
UTC = stamps(ISO)
PLAIN = table("time,v", UTC, VALUES)
DECIMAL_COMMAS = commas(VALUES)
NO_HEADER = Cleaning(no_header=True)
ELAPSED = [f"{k // 60}:{k % 60:02d}:00" for k in range(1_410, 1_410 + N)]
# form: lines down to the names, the time in a row or the times in all, the separator if it is no
# comma, the values in other forms
DATED = {
    "hundreds of blank lines": ("time,v" + "\n" * 400, ISO),
    "a compact date, hours and minutes": ("Date,Hour,Minute,v", "%Y%m%d,%H,%M"),
    "a compact date that is named by its form": ("YYYYMMDD,HH,Minute,v", "%Y%m%d,%H,%M"),
    "the beginning and the end of samples without length, each as a date and a time": (
        "day,clock,day2,clock2,v",
        "%F,%T,%F,%T",
    ),
    "a line of formats": (
        "agency_cd\tdatetime\t69928_00060\n5s\t20d\t14n",
        "USGS\t%Y-%m-%dT%H:%M:%SZ",
        "\t",
    ),
    "UTC in words": ("time,v", "%Y-%m-%d %H:%M:%S UTC"),
    "day of year": ("time,v", "%Y-%jT%H:%M:%S"),
    "day of year with colons": ("time,v", "%Y:%j:%H:%M:%S.%f"),
    "day, month in letters": ("Time,v", "%d-%b-%Y %H:%M:%S"),
    "month in letters first": ("Time;v", "%b %d, %Y %H:%M:%S", ";"),
    "a web server's": ("time,v", "%d/%b/%Y:%H:%M:%S +0000"),
    "slashes, the year first": ("t,v", "%Y/%m/%d %H:%M"),
    "date and time of day": ("date,clock,v", "%Y-%m-%d,%H:%M:%S"),
    "year and day of year": ("Year,DOY,Hour,Min,v", "%Y,%j,%H,%M"),
    "year, month and day": ("YYYY,MM,DD,HH,mn,v", "%Y,%m,%d,%H,%M"),
    "a compact date and a time of day": ("Date,Time,v", "%Y%m%d,%H:%M:%S"),
    "a date and a time of day, both with points": ("Date;Time;v", "%d.%m.%Y;%H.%M.%S", ";"),
    "months and minutes": ("YYYY,MM,DD,hh,mm,v", "%Y,%m,%d,%H,%M"),
    "a date, hours and minutes": ("date,hour,minute,v", "%Y-%m-%d,%H,%M"),
    "half days in a column": ("day,clock,half,v", "%d.%m.%Y,%I:%M:%S,%p"),
    "years of two digits behind letters": ("time,v", "%d-%b-%y %H:%M"),
    "names that count": (",0", "%Y-%m-%d %H:%M"),
    "a date with a blank between blanks": ("time v", "%Y-%m-%d %H:%M:%S", " "),
    "names in two lines": (",v\ntime,V", "%Y-%m-%d %H:%M"),
    "a spreadsheet's first line": ("\ufeffsep=;\ntime;v", "%Y-%m-%d %H:%M:%S", ";"),
    "names and units": ("time,v\n(UTC),V", ISO),
    "names and units in comments": (
        "#YY MM DD hh mm v\n#- - - - - m/s",
        "%Y %m %d %H %M",
        " ",
    ),
    "day of year in UTC": ("UTC,v", "%Y-%jT%H:%M:%S.000Z"),
    "a name without cells": ("time,v,comment", ISO),
    "tabs": ("time\tv", ISO, "\t"),
    "bars": ("time|v", ISO, "|"),
    "comments above": ("# written by a recorder\n#units,V\n\ntime,v", ISO),
    "spaces in the header": ("time, v", ISO),
    "year, month, day and a time of day": ("Year,Month,Day,Time,v", "%Y,%m,%d,%H:%M"),
    "a date, hours, minutes and seconds": ("date,hour,min,sec,v", "%Y-%m-%d,%H,%M,%S"),
    "dates of PVGIS": ("time,v", "%Y%m%d:%H%M"),
    "beginning and end with a dash": ("time,v", "%d.%m.%Y %H:%M - 01.04.2024 00:00"),
    "names in a comment above an empty one": ("# time,v\n#", ISO),
    "points": ("Zeit;U", "%d.%m.%Y %H:%M:%S", ";", DECIMAL_COMMAS),
    "years of two digits": ("Zeit;v", "%d.%m.%y %H:%M", ";", DECIMAL_COMMAS),
    "milliseconds since 1970": ("timestamp,v", 1000 * UNIX),
    "modified Julian dates": ("MJD,v", [f"{60370 + second / 86400:.9f}" for second in SECONDS]),
    "Julian dates": ("JD,v", [f"{2460370.5 + second / 86400:.9f}" for second in SECONDS]),
    "MATLAB's days": ("datenum,v", [f"{739312 + second / 86400:.9f}" for second in SECONDS]),
    "halves of a day in small letters": ("time,v", stamps("%Y-%m-%d %I:%M %p").str.lower()),
}
# form: lines down to the names, the times in the rows, the separator if it is no comma
COUNTED = {
    "an oscilloscope's": ("x-axis,1\nsecond,Volt", SECONDS),
    "milliseconds since boot": ("time_boot_ms,v", 1000 * SECONDS),
    "a unit below the name": ("Time,v\n[ms],V", 1000 * SECONDS),
    "a unit and a blank line below the name": ("Time,v\n(min),V\n", SECONDS / 60),
    "MATLAB's comments": ("% Model: a\n% Time, v", SECONDS),
    "seconds in brackets": ("Time (s),v", SECONDS),
    "milliseconds in the name": ("timestamp_ms,v", 1000 * SECONDS),
    "minutes elapsed": ("elapsed [min],v", ROWS),
    "capitals in the name": ("SimTime,v", SECONDS),
    "seconds written out": ("Time,v", [f"{second} sec" for second in SECONDS]),
    "a temperature beside the time": ("time,T", SECONDS),
    "NumPy's": ("# time v", [f"{second:.6e}" for second in SECONDS], " "),
    "NumPy's, with units": ("# t [s]  v", SECONDS, " "),
    "a unit of one": ("Time (1.0 s),v", SECONDS),
    "ISO 8601 durations": ("time,v", [f"PT{second}S" for second in SECONDS]),
}
# form: text
OTHERS = {
    "a date in the first row of the day": table(
        "date,clock,v", ["2024-03-01"] + [""] * (N - 1), CLOCK, VALUES
    ),
    "midnight as hour 24": timed("time,v", "%Y-%m-%d %H:%M").replace(
        "2024-03-01 00:00", "2024-02-29 24:00"
    ),
    "seconds of the day": table("year,doy,sod,v", stamps("%Y,%j"), SECONDS, VALUES),
    "a sign for the row number": table("#,time,v", range(N), MINUTES, VALUES),
    "the time once more": table("date,epoch,v", stamps("%Y-%m-%d %H:%M:%S"), UNIX, VALUES),
    "numbers of a server's entries": table("time,entry_id,v", UTC, range(700, 700 + N), VALUES),
    "quality after capitals": table("time,v,OPCQuality", UTC, VALUES, [192] * N),
    "row numbers of a table of which rows were left out": table(
        "Unnamed: 0,time,v", 3 * ROWS**2, UTC, VALUES
    ),
    "intervals in one cell": table(
        "period;v",
        [f"{a}/{b}" for a, b in zip(UTC, (*UTC[1:], UTC[0]), strict=True)],
        VALUES,
        separator=";",
    ),
    "units of several columns in columns of one name": table(
        "time,Units,v,Units", UTC, ["C"] * N, VALUES, ["V"] * N
    ),
    "row numbers of pandas": table("Unnamed: 0,time,v", range(N), UTC, VALUES),
    "a logger's four lines": table(
        'TOA5,"a","7"\n"TIMESTAMP","RECORD","v"\n"TS","RN","V"\n"","","Smp"',
        UTC,
        range(N),
        VALUES,
    ),
    "a log cut by a power failure": PLAIN + "\x00" * 300,
    "commas behind each line": table("time,v,", UTC, VALUES, [""] * N),
    "quoted decimal commas": table("time,v", UTC, [f'"{value}"' for value in DECIMAL_COMMAS]),
    "a byte order mark": "\ufeff" + PLAIN,
    "lines of another system": PLAIN.replace("\n", "\r\n"),
    "a stray carriage return": "\r" + PLAIN,
    "no end of the last line": PLAIN.rstrip("\n"),
    "the time last, and words": table("v,state,when", VALUES, ["on"] * N, UTC),
    "files joined with their headers": PLAIN.replace(
        "\n2024-03-01T00:30", "\ntime,v\n2024-03-01T00:30"
    ),
    "a stop of WinCC": table(
        "VarName;TimeString;VarValue",
        ["T"] * N,
        UTC,
        VALUES,
        separator=";",
        below="$RT_OFF$;2024-03-01T01:00:00Z;0\n",
    ),
    "elapsed times beside a clock": table("timestamp,uptime,v", UNIX, ELAPSED, VALUES),
    "seconds of the day beside hours and minutes": table(
        "Date,Time,sec,v", stamps("%Y-%m-%d,%H:%M"), SECONDS + 1, VALUES
    ),
    "minutes of the day": table("year,doy,minute,v", stamps("%Y,%j"), ROWS, VALUES),
    "units behind all numbers": table("time,v", UTC, [f"{value} °C" for value in VALUES]),
    "times of day without zeros": table(
        "date,time,v", DAYS, [f"{k.hour}:{k.minute}:0" for k in TIMES], VALUES
    ),
    "NaN of C": PLAIN.replace(f",{VALUES[30]}\n", ",-nan(ind)\n"),
}
# form: text whose times are counted from zero
OTHERS_COUNTED = {
    "the newest row first": table("time,v", SECONDS[::-1], VALUES[::-1]),
    "the time within a step, named by t": table(
        "Time[s],t-Step[s],v", SECONDS, SECONDS % 600, VALUES
    ),
    "lines about the measurement": timed(
        "Version\t2\n***End***\t\n\nX_Value\tv", SECONDS, "\t", DECIMAL_COMMAS
    ),
    "spans that fall": table("time,v", [f"{s} s" for s in SECONDS[::-1]], VALUES[::-1]),
    "row names of R": table(
        '"time" "v"', [f'"{1 + k}"' for k in range(N)], SECONDS + 1e-9, VALUES, separator=" "
    ),
    "the day of a test beside its clock": table("test_date,time_s,v", DAYS, SECONDS, VALUES),
    "LabVIEW's clock for each channel": table(
        "X_Value,v,X_Value,Comment", SECONDS, VALUES, SECONDS
    ),
}
# form: text, start of the series
LATER = {
    "dates and times of day as numbers": (
        table("Date,HHMM,v", NIGHT.strftime("%d.%m.%Y"), NIGHT.strftime("%-H%M"), VALUES),
        NIGHT[0],
    ),
    "compact dates and times of day with seconds": (
        table("Date,HHMMSS UTC,v", NIGHT.strftime("%Y%m%d"), NIGHT.strftime("%-H%M%S"), VALUES),
        NIGHT[0],
    ),
    "the day of the year, and 2400 at its end": (
        table(
            "Year,DOY,HHMM,v",
            *((NIGHT - pd.Timedelta("1min")).strftime(form) for form in ("%Y", "%j")),
            [f"{time:%-H%M}".replace("000", "2400") for time in NIGHT],
            VALUES,
        ),
        NIGHT[0],
    ),
    "the day of the year, and milliseconds behind a time of day": (
        table(
            "Year,DOY,HHMMSS,ms,v",
            *(NIGHT.strftime(form) for form in ("%Y", "%j", "%H%M%S")),
            [500] * N,
            VALUES,
        ),
        NIGHT[0] + pd.Timedelta("500ms"),
    ),
    "ISO 8601 with a comma": (
        timed("time;v", "%Y-%m-%d %H:%M:%S,500", ";"),
        "2024-03-01T00:00:00.5Z",
    ),
    "whole seconds and milliseconds": (
        timed("time,ms,v", "%Y-%m-%d %H:%M:%S,70"),
        "2024-03-01T00:00:00.07Z",
    ),
    "milliseconds in a third column": (
        timed("date,clock,ms,v", "%Y-%m-%d,%H:%M:%S,70"),
        "2024-03-01T00:00:00.07Z",
    ),
    "a time of day and microseconds": (
        timed("date,clock,usec,v", "%Y-%m-%d,%H:%M:%S,70000"),
        "2024-03-01T00:00:00.07Z",
    ),
    "whole seconds and nanoseconds": (
        timed("time,ns,v", "%Y-%m-%d %H:%M:%S,70000000"),
        "2024-03-01T00:00:00.07Z",
    ),
    "an offset in the name": (
        timed('"Time, GMT+02:30",v', "%Y-%m-%d %H:%M"),
        "2024-02-29T21:30Z",
    ),
    "midnight as the end of a day": (
        table(
            "date,clock,v",
            (TIMES + pd.Timedelta("23.49h")).strftime("%Y-%m-%d"),
            (TIMES + pd.Timedelta("23.5h")).strftime("%H:%M:%S"),
            VALUES,
        ).replace("2024-03-01,00:00:00", "2024-03-01,24:00:00"),
        "2024-03-01T23:30Z",
    ),
    "the time of TensorBoard": (
        table("Wall time,Step,v", 1_709_251_200.5 + SECONDS, range(N), VALUES),
        "2024-03-01T00:00:00.5Z",
    ),
    "a separator behind each row": (
        table("time,v,", 1 + SECONDS, VALUES, [""] * N),
        "1970-01-01T00:00:01Z",
    ),
    "elapsed times that pass a day late": (
        table("time,v", ELAPSED, VALUES),
        "1970-01-01T23:30Z",
    ),
}
READ = (
    {form: (timed(*layout), START) for form, layout in DATED.items()}
    | {form: (timed(*layout), ZERO) for form, layout in COUNTED.items()}
    | {form: (text, START) for form, text in OTHERS.items()}
    | {form: (text, ZERO) for form, text in OTHERS_COUNTED.items()}
    | LATER
)


@pytest.mark.parametrize("form", READ)
def test_a_form_is_read_with_its_times_and_values(written, form):
    text, start = READ[form]
    values = VALUES.copy()
    if form == "NaN of C":
        values[30] = (values[29] + values[31]) / 2
    report = check(one(written(text)), values, start)
    clock = report.findings[0]
    assert clock.kind == "clock"
    assert clock.details["last_ns"] - clock.details["first_ns"] == (N - 1) * 60 * 10**9


def dates(form, step):
    return pd.date_range(START, periods=N, freq=step).strftime(form)


# form: lines down to the names, the time in a row or the times in all, words of the refusal, and
# the interval in seconds if following the advice leads to the values
REFUSED_TIMES = {
    "a ramp": ("counter,v", 5 * ROWS, "--time counter", 5),
    "a name that is no clock's": ("T,v", 5 * ROWS, "--time T", 5),
    "times of day without colons from midnight": (
        "Time,v",
        [f"{number // 60:02}{number % 60:02}00" for number in 7 * SECONDS // 60],
        "times of day or seconds",
    ),
    "days of a spreadsheet": (
        "Date,v",
        [f"{45352 + second / 86400:.8f}" for second in SECONDS],
        "excel from 2024-03-01",
        60,
    ),
    "year and day in one number": (
        "date,v",
        dates("%Y%j", "D"),
        "%Y%j",
        86_400,
    ),
    "the time first": (
        "time,v",
        "%H:%M:%S %d-%m-%Y",
        "at line 2",
    ),
    "an unknown form of time": ("when,v", "%y-%jT%H:%M", "'24-061T00:00'", 1),
    "times since 1970 without a name": (",v", UNIX, "--time 'column 0'", 60),
    "date and hour in one number": (
        "date,v",
        HOURS.strftime("%Y%m%d%H"),
        "%Y%m%d%H",
        3_600,
    ),
    "times of day alone": ("clock,v", CLOCK, "--time-format %H:%M:%S", 60),
    "two clocks": (
        "event_time,received_time,v",
        "%Y-%m-%d %H:%M,%Y-%m-%d %H:%M:01",
        "event_time, received_time",
        60,
    ),
    "a clock without a name": (
        "",
        250 * ROWS,
        "--no-header",
        0.25,
    ),
    "a clock that stays": ("time,v", ROWS // 5, "named like one and does not", 1),
    "years of two digits in front or behind": (
        "time,v",
        "%y/%m/%d %H:%M",
        "--time-format '%y/%m/%d %H:%M'",
    ),
    "decimal years": ("time,v", 2020 + SECONDS / 86_400, "decimal years or seconds"),
    "times of day in numbers": (
        "time,v",
        [f"12{minute:02d}00" for minute in range(N)],
        "times of day or seconds",
    ),
    "microseconds since boot": ("timestamp,v", 623_456_789 + 19_987 * ROWS, "--time-format us"),
    "seconds since 1904": ("time,v", UNIX + 2_082_844_800, "1980 to 2077"),
    "seconds since 1980": ("gps_time,v", UNIX - 315_964_782, "--time gps_time"),
    "a zone beside the times": ("time,tz_offset,v", "%Y-%m-%d %H:%M,+02:00", "time, tz_offset in"),
    "a zone in the name": ("Time (CET),v", MINUTES, "--timezone"),
    "days or months first": (
        "time,v",
        dates("%d/%m/%Y", "31D")[:2].repeat(N // 2),
        "--time-format %m/%d/%Y",
    ),
    "a date and a time in numbers": ("Date,Time,v", "%Y%m%d,%H%M%S", "one column"),
    "a zone in letters": ("time,v", "%Y-%m-%d %H:%M CET", "offset such as +01:00"),
    "digits that a spreadsheet dropped": (
        "time,v",
        ["1.70925E+12"] * N,
        "a clock that lost digits",
    ),
    "minutes where there are seconds": (
        "time,v",
        ["2024-03-01 00:00", "2024-03-01 00:01"] * 30,
        "2 different",
    ),
    "hours and minutes in one number": (
        "Time,v",
        (TIMES + pd.Timedelta("9h30min")).strftime("%H%M"),
        "times of day or seconds",
    ),
    "times of day under another name": ("hms,v", CLOCK, "with a date"),
    "a multiple of a unit": ("Time [10ms],v", 6_000 * ROWS, "multiple of a unit"),
    "steps of 100 ns since 1601": (
        "time,v",
        133_537_536 * 10**9 + 10**7 * SECONDS,
        "from 1601 or 1904",
    ),
    "times since 1970 and no names": (
        "",
        1_709_287_200 + SECONDS,
        "--no-header",
        60,
    ),
    "a clock that begins again": ("time,v", [*range(40), *np.arange(0.5, 20)], "at line 42"),
    "a time of day": ("time,v", CLOCK, "column of dates"),
    "microseconds from zero": (
        "time,v",
        2_000 * ROWS,
        "--time-format us",
        0.002,
    ),
    "a zone in letters in another column": (
        "gps,device,v",
        "%a %b %d %H:%M:%S PDT %Y,%Y-%m-%d %H:%M",
        "PDT 2024",
        60,
    ),
    "a zone beside the table": (
        "zone\nEurope/Berlin\n\ntime,v",
        MINUTES,
        "--timezone Europe/Berlin",
        60,
    ),
    "an index without a name that varies": (
        ",v",
        SECONDS + 20 * np.sin(ROWS).round(2),
        "--time 'column 0'",
    ),
}
# the same with the text of the table
REFUSED_TEXTS = {
    "a ramp in front of each signal": (
        table("t1,v,t2,w", 5 * ROWS, VALUES, 2 * ROWS, VALUES),
        "--time t2 --column w",
        5,
    ),
    "a date and a time of day with nothing between them": (
        timed("time;v", "%d.%m.%y%H:%M:%S", ";"),
        "--time-format",
    ),
    "a clock behind a counter": (
        table("Pt,T,v", range(N), SECONDS, VALUES),
        "--time T",
        60,
    ),
    "a clock that says more in its name": (
        table("n,time approx (s),v", range(N), SECONDS + ROWS % 2, VALUES),
        "--time 'time approx (s)'",
        60,
    ),
    "columns below lines of text": (
        table("STATION 1\n[HEADER]\nheight = 3\n[DATA]", MINUTES, VALUES, separator="\t"),
        "--no-header",
        60,
    ),
    "states that change often": (
        table("time,mode,v", MINUTES, ["A", "B"] * 30, VALUES),
        "column mode",
        60,
    ),
    "the text of sar": (
        table(
            "Linux 5.4.0 (host1)\t03/01/2024\t_x86_64_\n\n12:00:01 AM  %user  %idle",
            stamps("%I:%M:%S %p"),
            VALUES,
            100 - VALUES,
            separator="  ",
        ),
        "sadf -d",
    ),
    "frames of a CAN bus": ("".join(f"({second}.25) can0 1A0#00FF\n" for second in SECONDS), "DBC"),
    "vectors in brackets": (
        "# Forces\n" + "".join(f"{value}\t((1 2 3) (4 5 6))\n" for value in VALUES),
        "without brackets",
    ),
    "a page": ("<!DOCTYPE html>\n<table>\n" + PLAIN, "pandas.read_html"),
    "a log of a serial monitor": (
        timed("00:00:00.012 -> 20.1", "%H:%M:%S.012", " -> "),
        "a comma instead of ' -> '",
    ),
    "names beside their values": (
        "".join(f"Temp: {value} C\n" for value in VALUES),
        "--no-header",
        1,
    ),
    "a name and its value in one cell": (
        "".join(f"Temp:{value}C\n" for value in VALUES),
        "only numbers below a line of names",
    ),
    "blanks between columns without names, below two other lines": (
        table(
            "Albuquerque\n 35.04 -106.6 1617 version 1",
            range(10, 10 + N),
            VALUES,
            separator="  ",
        ),
        "--no-header",
        1,
    ),
    "seconds and nanoseconds": (
        table("sec,nanosec,v", UNIX // 120 * 120, [0, 500] * (N // 2), VALUES),
        "--time sec",
    ),
    "one date past midnight": (
        table(
            "date,clock,v",
            DAYS,
            (TIMES + pd.Timedelta("23.5h")).strftime("%H:%M"),
            VALUES,
        ),
        "one day, as where a date stays past midnight, at line 32",
    ),
    "a point where there are commas": (
        timed("Zeit;U", "%d.%m.%Y %H:%M", ";", ["1.234"] * N),
        "'1.234'",
    ),
    "no names": (table("0.0,20.0", SECONDS[1:] + 0.5, VALUES[1:]), "--no-header"),
    "thousands or decimals": (table("time;v", MINUTES, ["1,500"] * N, separator=";"), "--decimal"),
    "points and commas": (
        table("time;v;w", MINUTES, DECIMAL_COMMAS, VALUES, separator=";"),
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
        timed("Date;Heure;T", "31/%m/2024;%Hh%M", ";"),
        "one column, as 2024",
    ),
    "a date that stays and a time without a unit": (
        table("date,time,v", DAYS, ROWS, VALUES),
        "--time time",
    ),
    "a finer clock beside dates": (
        table("time_ms,date,v", 500 * ROWS, MINUTES.repeat(30)[:N], VALUES),
        "--time time_ms",
    ),
    "another table further down": (
        table("time,v", SECONDS, VALUES, below="time,w\n3600,1\n"),
        "time, w at line 62",
    ),
    "a date and hours and minutes in one number": (
        table("date,time,v", DAYS, (TIMES + pd.Timedelta("9h")).strftime("%H%M"), VALUES),
        "one column, as 2024",
    ),
    "a clock behind each signal": (
        table("v,v_time,w,w_time", VALUES, SECONDS, VALUES, 2 * SECONDS),
        "--time w_time --column w",
    ),
    "a longer line": (
        table("time,v", MINUTES, VALUES).replace(f",{VALUES[5]}\n", ",1,2,3\n", 1),
        "line 7 has 4",
    ),
    "a cell that is left out between blanks": (
        table("t v w", SECONDS, VALUES, VALUES, separator=" ").replace(f" {VALUES[5]}", "", 1),
        "line 7 has 2",
    ),
    "a sum at the end": (PLAIN + "Average,20.1\n", "'Average' at line 62"),
    "another unit behind some numbers": (
        table("time,v", SECONDS, [f"{value} {'V' if value > 16 else 'mV'}" for value in VALUES]),
        f"mV' at line {2 + np.argmax(VALUES <= 16)}",
    ),
    "a number and a flag in one cell": (
        table("time,v", UTC, [f'"{round(100 * value)},{k % 2}"' for k, value in enumerate(VALUES)]),
        "values and flags in columns of their own",
    ),
    "dates of another zone than others beside them": (
        table("time,iso,v", stamps("%F %T"), stamps("%FT%T+01:00"), VALUES),
        "1 h apart",
        60,
    ),
    "a quotation mark without its pair, and another one further down": (
        PLAIN.replace(f",{VALUES[5]}", f',"{VALUES[5]}').replace(
            f",{VALUES[20]}", f',{VALUES[20]}"'
        ),
        "line 7",
    ),
    "a zone above the table": (
        table("# Timezone: -07:00\ntime,v", stamps("%F %T"), VALUES),
        "Timezone: -07:00",
        60,
    ),
    "a zone in letters": (table("Time (AEST),v", stamps("%F %T"), VALUES), "(AEST)", 60),
    "days since another zero": (
        table("time (days since 2020-01-01),v", SECONDS, VALUES),
        "another zero than 1970",
    ),
    "another zero in a line of units": (
        table("time,v\nhours since 1900-01-01,V", SECONDS, VALUES),
        "another zero than 1970",
    ),
    "dates of another zone than times since 1970 beside them": (
        table("unix,time,v", UNIX, stamps("%Y-%m-%d 10:%M:%S"), VALUES),
        "10 h apart",
        60,
    ),
    "semicolons, decimal commas and no names": (
        table("", SECONDS, DECIMAL_COMMAS, DECIMAL_COMMAS, separator=";"),
        "--no-header",
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
    "two tables": (
        table("time,a,b", UTC, VALUES, VALUES, below=PLAIN),
        f"--skip-rows {N + 1}",
        60,
    ),
    "three rows of another table": (
        table("time,a,b", UTC[:3], VALUES[:3], VALUES[:3], below=PLAIN),
        "--skip-rows 4",
        60,
    ),
    "numbered places one after the other": (
        table("location_id,time,v", [0] * N, UTC, VALUES) + table("", [1] * N, UTC, VALUES),
        "--series-column location_id",
    ),
    "a clock before each signal, behind a column of marks": (
        table("mark,TIME,v,TIME,w", ["x"] * N, SECONDS, VALUES, SECONDS + 40, VALUES),
        "--time TIME.2 --column w",
        60,
    ),
    "equal names": (table("time,v,v", SECONDS, VALUES, VALUES), "v.1, v.2"),
    "names without an end": ("time,v", "rows below the header"),
    "names without an end around a blank": ("time v", "rows below the header"),
    "a name in quotes without an end": ('"time"', "rows below the header"),
    "a damaged time of day that makes no elapsed times": (
        table("date,clock,v", DAYS, [*CLOCK[:30], "99:59:59", *CLOCK[31:]], VALUES),
        "'2024-03-01 99:59:59' at line 32",
    ),
    "numbered sensors": (
        table("time,sensor_id,v", UTC.repeat(2), [7, 8] * N, 0.5 * np.arange(2 * N)),
        "--series-column sensor_id",
    ),
}
REFUSED = REFUSED_TEXTS | {
    form: (timed(names, times), *others) for form, (names, times, *others) in REFUSED_TIMES.items()
}


ADVICE = "Give Write Rename Read Correct Name Add Convert Choose Save Complete".split()


def has_values(ending, interval_s):
    """Whether a channel has the known values at an interval."""
    found = [cleaned.longest for cleaned in (ending.channels or {}).values()]
    return any(
        part.interval_s == pytest.approx(interval_s) and np.allclose(part.values[:, 0], VALUES)
        for part in found
        if len(part) == N
    )


@pytest.mark.parametrize("form", REFUSED)
def test_a_form_with_two_meanings_is_refused_and_read_as_the_message_says(written, refused, form):
    text, words, *interval_s = REFUSED[form]
    path = written(text)
    with refused(words):
        for series in read_source(path).values():
            clean(series)
    endings = follow([shlex.quote(str(path))])
    if interval_s:
        assert any(has_values(ending, *interval_s) for ending in endings), endings
    else:
        assert any(ending.channels for ending in endings) or all(
            ending.message.rpartition(". ")[2].split()[0] in ADVICE for ending in endings
        ), endings


@pytest.mark.parametrize(
    ("header", "form", "interval_s", "values"),
    [
        ("Year,Month,Day,Mean,Min,Max", "%Y,%m,%d", 86_400, [8, 9, 7]),
        ("Year,Month,Day,mm,b,c", "%Y,%m,%d", 86_400, [3, 5, 2]),
        ("time,ms,b,c", "%Y-%m-%dT%H:%M:%S", 1, [23, 950, 480]),
        ("time,ns,b,c", "%Y-%m-%dT%H:%M:%S", 1, [5, 7, 6]),
    ],
)
def test_what_is_named_like_a_part_of_a_time_but_is_none_is_a_channel(
    written, header, form, interval_s, values
):
    times = pd.date_range("2024-03-01", periods=12, freq=f"{interval_s}s").strftime(form)
    text = table(header, times, 4 * values, 4 * [3, 5, 2], 4 * [14, 15, 12])
    channels = read_source(written(text))
    names = header.split(",")[-3:]
    assert list(channels) == names
    assert clean(channels[names[0]]).telemetry.interval_s == interval_s


@pytest.mark.parametrize(
    ("header", "form", "step"),
    [
        ("Date,Hour,HHMM,v", "%Y-%m-%d,%H", "h"),
        ("Date,Time,HHMM,v", "%Y-%m-%d,%H:%M", "min"),
        ("Date,Run time (HHMM),v", "%Y-%m-%d", "D"),
    ],
)
def test_the_time_of_day_of_something_else_moves_no_row(written, header, form, step):
    times = pd.date_range(START, periods=N, freq=step)
    text = table(header, times.strftime(form), 100 * (ROWS % 24) + ROWS * 7 % 60, VALUES)
    check(read_source(written(text))["v"], interval_s=(times[1] - times[0]).total_seconds())


@pytest.mark.parametrize("part", ["second", "hour"])
def test_a_part_of_a_time_that_is_out_of_range_loses_its_row_alone(part):
    frame = pd.DataFrame(
        {"year": 2024, "month": 3, "day": 1, "hour": TIMES.hour, "minute": TIMES.minute}
    ).assign(second=0, v=VALUES)
    frame.loc[30, part] = 99
    cleaned = clean(one(frame))
    assert cleaned.report.find("missing times").count == 1
    np.testing.assert_allclose(
        np.delete(cleaned.telemetry.values[:, 0], 30), np.delete(VALUES, 30), atol=1e-5
    )


def test_lines_that_repeat_the_names_leave_no_gap(written):
    channels = read_source(written("a,b\n1.5,2\n2.5,x\na,b\n4.5,5\n5.5,y\n"))
    assert clean(channels["a"]).telemetry.values[:, 0].tolist() == [1.5, 2.5, 4.5, 5.5]
    assert [channels["b"].places.of(row) for row in (1, 3)] == ["line 3", "line 6"]


def test_numbers_that_turn_hexadecimal_further_down_are_words(written, refused):
    cells = [f"{number:02X}" for number in [*range(16, 26)] * 30 + [*range(160, 256)]]
    text = table("time,code,v", range(396), cells, range(396))
    assert list(read_source(written(text))) == ["v"]
    text = table("time,code,v", range(301), [*cells[:300], "5A"], range(301))
    with refused("'5A' at line 302"):
        clean(read_source(written(text))["code"])


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (250 * ROWS, "--time 'column 0' --time-format ms"),
        ((SECONDS + 20 * np.sin(ROWS)).round(2), "--time 'column 0'"),
    ],
    ids=["steps of no whole second", "steps of any length"],
)
def test_a_column_without_a_name_that_does_not_count_by_one_may_be_the_clock(
    written, refused, times, words
):
    with refused(words):
        read_source(written(timed("", times)), options=NO_HEADER)


def test_samples_that_are_counted_are_not_said_to_need_an_interval():
    with pytest.raises(InputError, match="at least 2 in a row") as refused:
        clean(pd.Series([1.0, *[np.nan] * 9, 2.0, *[np.nan] * 9]))
    assert refused.value.options == ({"max_fill": 50},)


def test_units_that_change_from_row_to_row_tell_series_apart():
    units = np.where(ROWS < 30, "V", "mV")
    channels = read_source(framed(unit=units))
    check(channels["V"], VALUES[:30])
    check(channels["mV"], VALUES[30:], TIMES[30])


def test_a_column_that_does_not_increase_is_no_clock(written):
    channels = read_source(written(table("T,p", VALUES, VALUES**2)))
    assert list(channels) == ["T", "p"]
    clock = check(channels["T"], start=None, interval_s=1.0).find("clock")
    assert clock.details["column"] is None


@pytest.mark.parametrize(
    ("offset", "hours"), [("+05", 5), ("+0530", 5.5), ("+05:30", 5.5), ("Z", 0)]
)
def test_a_stated_offset_goes_before_the_option(written, offset, hours):
    path = written(timed("time,v", f"%Y-%m-%d %H:%M:%S{offset}"))
    for zone in ("Asia/Tokyo", None):
        start = START - pd.Timedelta(hours=hours)
        report = check(one(path), start=start, options=Cleaning(timezone=zone))
        clock = report.find("clock").text
        assert "stated" in clock and ("goes before Asia/Tokyo" in clock) == (zone is not None)


@pytest.mark.parametrize("form", ["%H:%M:%S %d-%m-%Y", "%d.%m.%y%H:%M:%S"])
def test_a_time_is_read_in_a_format_and_a_zone_that_are_given(written, form):
    options = Cleaning(time_format=form, timezone="America/New_York")
    series = one(written(timed("time,v", form)), options=options)
    check(series, start="2024-03-01T05:00Z", options=options)


@pytest.mark.parametrize("shift_s", [0, 7])
@pytest.mark.parametrize("begin", ["2024-10-26T22:00Z", "2024-10-27T00:10Z"])
def test_an_hour_that_a_clock_repeats_is_two_hours(written, begin, shift_s):
    places = np.arange(200)
    utc = pd.date_range(begin, periods=200, freq="10min")
    utc += pd.to_timedelta(shift_s * (places % 2), unit="s")
    local = utc.tz_convert("Europe/Berlin").strftime("%Y-%m-%d %H:%M:%S")
    options = Cleaning(timezone="Europe/Berlin")
    series = one(written(table("time,v", local, places % 7)), options=options)
    cleaned = clean(series, options)
    assert (cleaned.report.rows_used, len(cleaned.parts)) == (200, 1)
    assert abs(pd.Timestamp(cleaned.parts[0].start) - utc[0]) < pd.Timedelta("10s")


def long(**keys):
    """Two series at the same times, told apart by columns of words; the second is 9 higher."""
    frame = pd.DataFrame(
        {"time": TIMES.repeat(2), **{name: list(words) * N for name, words in keys.items()}}
    )
    return frame.assign(v=VALUES.repeat(2) + np.tile([0, 9], N))


HOSTS = long(host=("a", "b"))
SERIES = {
    "rows in turn": HOSTS,
    "one after the other": HOSTS.sort_values("host", kind="stable"),
    "a column of another name": long(which=("a", "b")),
    "two columns that say the same": long(sensor=("a", "b"), place=("north", "south")),
    "other times": HOSTS.assign(
        time=TIMES.repeat(2) + pd.to_timedelta(np.tile([0, 30], N), unit="s")
    ),
}


@pytest.mark.parametrize("form", SERIES)
def test_several_series_in_one_table_are_told_apart(written, form):
    channels = read_source(written(SERIES[form]))
    assert list(channels) == ["a", "b"]
    check(channels["a"])
    late = pd.Timedelta("30s" if form == "other times" else "0s")
    assert check(channels["b"], VALUES + 9, START + late).find("series").count == 2


def of_influxdb(*columns, above=""):
    """A table as InfluxDB exports it, with a blank line behind it."""
    return table(f"{above},result,table,_time,_value,_field", *columns, below="\n")


def test_a_blank_line_at_the_end_of_several_series_is_none_of_them(written):
    text = of_influxdb(
        [",_result,0"] * N + [",_result,1"] * N,
        UTC.append(UTC),
        [*VALUES, *(VALUES + 1)],
        ["amps"] * N + ["volts"] * N,
    )
    channels = read_source(written(text.replace("\n", "\r\n")))
    cells = {name: series.cells.to_list() for name, series in channels.items()}
    assert cells == {"amps": VALUES.tolist(), "volts": (VALUES + 1).tolist()}


@pytest.mark.parametrize(
    ("frame", "names", "options"),
    [
        (HOSTS, ["a", "b"], Cleaning()),
        (long(number=(7, 8)), ["7", "8"], Cleaning(series_column="number")),
    ],
)
def test_the_columns_of_series_and_values_can_be_named(frame, names, options):
    frame = frame.assign(other=1.0)
    channels = read_source(frame, ["v"], options=options)
    assert list(channels) == names
    check(channels[names[1]], VALUES + 9)
    last = f"{names[1]}.v"
    assert list(read_source(frame, [last], options=options)) == [last]
    assert len(read_source(frame, options=options)) == 4


def annotated(field, values, result="_result"):
    above = (
        "#group,false,false,true,false,true\n"
        "#datatype,string,long,dateTime:RFC3339,double,string\n"
        f"#default,{result},,,,\n"
    )
    return of_influxdb([",,0"] * N, UTC, values, [field] * N, above=above)


def test_tables_of_annotated_csv_are_series(written):
    channels = read_source(written(annotated("volts", VALUES) + annotated("amps", 2 * VALUES)))
    assert list(channels) == ["volts", "amps"]
    check(channels["volts"])
    check(channels["amps"], 2 * VALUES)
    # 3 annotations, names, 60 rows, a blank line, and 4 more
    assert channels["amps"].places.of(0) == "line 70"
    text = annotated("volts", VALUES, "mean") + annotated("volts", 2 * VALUES, "max")
    assert list(read_source(written(text))) == ["mean", "max"]


IS_ANOMALOUS = ROWS % 20 == 3
LABELS = {
    "zeros and ones": IS_ANOMALOUS.astype(int),
    "true and false": IS_ANOMALOUS,
    "words": np.where(IS_ANOMALOUS, "Attack", "Normal"),
    "minus one": np.where(IS_ANOMALOUS, -1, 1),
}


@pytest.mark.parametrize("form", LABELS)
@pytest.mark.parametrize("name", ["is_anomaly", "label", "Normal/Attack"])
def test_labels_are_no_channel_and_mark_rows(name, form):
    frame = pd.DataFrame({"timestamp": TIMES, "v": VALUES, name: LABELS[form]})
    kept = check(one(frame))
    assert kept.find("labels").count == 3 and f"'{name}'" in kept.find("labels").text
    missing = clean(one(frame, options=Cleaning(labelled="missing"))).report
    assert (missing.find("missing values").rows_left_out, missing.samples) == (3, N)


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ([0, 1, 2], [0, 1, 1]),
        ([0, np.nan, 1], [0, 0, 1]),
        ([1, 1], [1, 1]),
        ([-1, 1, np.nan], [1, 0, 0]),
        ([2, 3], None),
        ([np.nan, np.nan], [0, 0]),
        (["normal", "attack", None], [0, 1, 0]),
        (["attack", None], [1, 0]),
        (["high", "low"], None),
    ],
)
def test_what_a_label_says_by_hand(cells, expected):
    found = anomalous(pd.Series(cells))
    assert (found if found is None else found.tolist()) == expected


def test_a_label_may_be_named_or_refused_and_may_concern_one_channel():
    marks = LABELS["zeros and ones"]
    frame = pd.DataFrame(
        {"time": TIMES, "ch1": VALUES, "ch2": -VALUES, "is_anomaly_ch1": marks, "state": marks}
    )
    first, second = (
        clean(series).report.find("labels")
        for series in read_source(frame, ["ch1", "ch2"]).values()
    )
    assert first is not None and second is None
    named = read_source(frame, options=Cleaning(label_column="state"))
    assert list(named) == ["ch1", "ch2", "is_anomaly_ch1"]
    assert clean(named["ch2"]).report.find("labels").count == 3
    assert "state" in read_source(frame, options=Cleaning(label_column="none"))


def test_quality_flags_counts_and_states_beside_a_clock_are_named_and_left_out():
    frame = framed(v_quality=192, number=range(N), valve=["open"] * 20 + ["closed"] * 40)
    report = check(one(frame))
    assert "v_quality" in report.find("quality flags").text
    assert "number" in report.find("row numbers").text
    assert "--states" in report.find("columns left out").text


IS_FILLED = ROWS % 20 == 5


@pytest.mark.parametrize("fill", [9999.0, -999.9, 1e20])
def test_fill_values_are_reported_and_left_out_when_named(fill):
    series = pd.Series(np.where(IS_FILLED, fill, VALUES), index=TIMES)
    found = clean(series).report.find("fill values")
    assert found.details["values"] == [fill] and "--missing-values" in found.text
    cleaned = clean(series, Cleaning(missing_values=[fill]))
    assert cleaned.report.rows_left_out == 3 and cleaned.parts[0].values[:, 0].max() < 26


@pytest.mark.parametrize(
    ("values", "is_found"),
    [
        (np.where(IS_FILLED, 100.0, ROWS % 10), True),
        (np.where(IS_FILLED, 100.0, ROWS % 9), False),
        (np.where(IS_FILLED, 100.0, 0.0), False),
        (np.where(ROWS == 5, 9999.0, VALUES), False),
        (VALUES, False),
    ],
    ids=["ten others", "nine others", "states", "a single spike", "none"],
)
def test_a_value_that_repeats_beside_at_least_ten_others_is_a_fill_value(values, is_found):
    found = clean(pd.Series(values, index=TIMES)).report.find("fill values")
    assert (found is not None) == is_found


def test_one_decimal_sign_holds_for_all_columns(written):
    watts = 950 + ROWS
    texts = [f"{watt / 1000:.3f}" if watt >= 1000 else str(watt) for watt in watts]
    text = table("time;watts;celsius", MINUTES, texts, DECIMAL_COMMAS, separator=";")
    channels = read_source(written(text))
    check(channels["watts"], watts)
    check(channels["celsius"])
    texts = [f'"{watt:,}.5"' if watt >= 1000 else f"{watt}.5" for watt in watts]
    check(one(written(table("time,watts", MINUTES, texts))), watts + 0.5)


def test_steps_are_measured_before_gaps_are_filled():
    values = pd.Series(
        np.tile(VALUES.round(1), 20), index=pd.date_range(START, periods=20 * N, freq="s")
    )
    values = values.drop(values.index[: 60 * 20 : 20])
    assert clean(values).report.find("quantised").details["step"] == pytest.approx(0.1)


def test_files_of_several_days_are_one_table(tmp_path, refused):
    header, *lines = PLAIN.splitlines(keepends=True)
    days = {"day1.csv": lines[:30], "day2.csv": lines[30:49], "day10.csv": lines[49:]}
    (tmp_path / "notes.txt").write_text("not read")
    for name, rows in days.items():
        (tmp_path / name).write_text("".join([header, *rows]))
    report = check(one(tmp_path))
    assert "day1.csv to day10.csv" in report.find("files").text
    series = one([tmp_path / name for name in days])
    assert series.places.of(30) == "line 2 of day2.csv"
    (tmp_path / "day2.csv").write_text("time,w\n2024-03-02,1\n")
    with refused("'v' not exactly once in day1.csv and day2.csv"):
        read_source(tmp_path)


def test_a_packed_file_is_read(tmp_path, refused):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("inside.CSV", PLAIN)
    check(one(path))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("second.csv", PLAIN)
    with refused("inside.CSV, second.csv"):
        read_source(path)


def test_pandas_objects_are_sources():
    frame = framed()
    check(one(frame))
    check(one(frame.set_index("time")["v"]))
    parts = pd.DataFrame({"year": 2024, "month": 3, "day": 1, "second": SECONDS, "v": VALUES})
    check(one(parts.iloc[5:]), VALUES[5:], TIMES[5])


@pytest.mark.parametrize("form", ["labelled.csv", "labelled.parquet", "timeeval.csv"])
def test_the_files_of_this_tool_are_read_back(tmp_path, form):
    cleaned = clean(pd.Series(VALUES, index=TIMES, name="value"))
    frame = inject(cleaned.parts, InjectOptions(at=("level_shift:4@20/10",), noise_sd=1.0)).table
    write_table(tmp_path / form, frame, ["value"] if form == "timeeval.csv" else ())
    series = one(tmp_path / form)
    report = check(series, frame["value"])
    assert series.name == "value" and report.find("labels").count == 10


def test_copies_of_a_run_are_series():
    frame = (
        long(copy=(0, 1))
        .rename(columns={"v": "value"})
        .assign(out_of_range=0.5, scenario="worn", severity=0.5, mask=1)
    )
    channels = read_source(frame)
    assert list(channels) == ["copy 0", "copy 1"]
    check(channels["copy 1"], VALUES + 9)


def test_names_may_be_missing(written):
    path = written("\n".join(f"  {value:.7e}" for value in VALUES), "a.txt")
    series = one(path, options=NO_HEADER)
    check(series, start=None, interval_s=1.0)
    assert series.name == "column 0"


def test_whole_and_fractional_seconds_are_read_in_one_column(written):
    times = [
        text + ("" if row % 2 else ",250") for row, text in enumerate(stamps("%d.%m.%Y %H:%M:%S"))
    ]
    stamped = one(written(table("time;v", times, VALUES, separator=";"))).times.stamps
    assert stamped[0] == pd.Timestamp("2024-03-01T00:00:00.25")
    assert stamped[1] - stamped[0] == pd.Timedelta("59.75s")


def test_a_year_and_a_month_are_the_first_day_of_the_month():
    frame = pd.DataFrame({"year": 1990 + ROWS // 12, "month": 1 + ROWS % 12, "v": VALUES})
    assert one(frame).times.stamps[-1] == pd.Timestamp("1994-12-01")


def test_files_over_the_same_times_are_no_parts_of_one_series(tmp_path, refused):
    (tmp_path / "volts.csv").write_text(PLAIN)
    (tmp_path / "amps.csv").write_text("".join(PLAIN.splitlines(keepends=True)[:20]))
    with refused("amps.csv and volts.csv over the same times"):
        read_source(tmp_path)


def test_few_different_numbers_with_one_unit_are_numbers():
    parsed, bad, _ = parse_numbers(["960.5 hPa", "961.0 hPa"], "")
    assert parsed.tolist() == [960.5, 961] and not bad.any()


def test_a_channel_that_cannot_be_read_leaves_the_others_as_an_option(written, refused):
    sparse = ["" if k not in (3, 40) else 5 for k in range(N)]
    path = written(table("time,v,w", UTC, VALUES, sparse))
    with refused("--column v"):
        read_telemetry(path, Cleaning(min_part=3))
    (telemetry,) = read_telemetry(path, Cleaning(min_part=3), ["v"])
    assert len(telemetry) == N


HALVES = [f'"{20 + k % 3},{5 * (k % 2)}"' for k in range(N)]
# form: text or frame, its channels
ORDINARY = {
    "a line above the names": (table("Rate,100\ntime,v", UTC, VALUES), ["v"]),
    "numbers of channels above the names": (
        table("Probe,Gain,Offset\np0,1,0\np1,1,1\np2,1,2\ntime,v,w,x", UTC, *[VALUES] * 3),
        ["v", "w", "x"],
    ),
    "quotes above the names and a gap in the last column": (
        table('5" tube\ntime,v,w', UTC, VALUES, VALUES).replace(
            f",{VALUES[7]},{VALUES[7]}\n", f",{VALUES[7]},\n"
        ),
        ["v", "w"],
    ),
    "depths that tell series apart": (
        table("time,depth,v", UTC.repeat(2), ["10 cm", "20 cm"] * N, range(2 * N)),
        ["10 cm", "20 cm"],
    ),
    "numbers with two colons": (
        table("date,port,v", MINUTES, [f"0:1:{k % 7}" for k in range(N)], VALUES),
        ["v"],
    ),
    "decimals in steps of a half": (
        table("time,v,w", UTC, HALVES, [f'"{v}"' for v in DECIMAL_COMMAS]),
        ["v", "w"],
    ),
    "a sentence with a comma above blanks": (
        timed("Hall, 2\nt v", commas(SECONDS + 0.5), " ", DECIMAL_COMMAS),
        ["v"],
    ),
    "names with decimal commas around": (
        timed("time, s\tv, V", SECONDS, "\t", DECIMAL_COMMAS),
        ["v, V"],
    ),
    "a place beside times in UTC": (
        table("# at Europe/Berlin\ntime (UTC),v", MINUTES, VALUES),
        ["v"],
    ),
    "ends of intervals since 1970": (
        table("open_time,close_time,v", UTC, 1_709_254_799 + SECONDS, VALUES),
        ["v"],
    ),
    "names that are numbers behind that of the clock": (
        table("time,31.5,63", UTC, VALUES, VALUES),
        ["31.5", "63"],
    ),
    "a number and its quality in one cell": (
        table("time,air,v", MINUTES, ['"+0200,1"'] * N, VALUES),
        ["v"],
    ),
    "a state that tells no series apart": (
        framed(mode=np.where(ROWS % 20 < 10, "sun", "eclipse")),
        ["v"],
    ),
    "limits of channels above the names": (
        "".join(f"c{k},-10,10\n" for k in range(12)) + PLAIN,
        ["v"],
    ),
    "row numbers above a blank last line": (
        table("time,id,v", UTC, range(11, 11 + N), VALUES, below=",,\n"),
        ["v"],
    ),
    "keys that look like hours": (
        pd.DataFrame({"date": dates("%Y-%m-%d", "D")[:30].repeat(2)}).assign(
            age=["18-24", "25-34"] * 30, v=VALUES
        ),
        ["18-24", "25-34"],
    ),
    "scores of this tool": (
        pd.DataFrame({"time": TIMES, "value": VALUES, "score": VALUES / 30}).assign(
            flag=VALUES > 24, score_after=VALUES / 40
        ),
        ["value"],
    ),
    "rows that were chosen from a frame": (
        framed()[VALUES > 16],
        ["v"],
    ),
    "parts of the time beside it": (
        pd.DataFrame({"time": HOURS, "DOY": HOURS.day_of_year, "Hour": HOURS.hour}).assign(
            mm=VALUES, v=VALUES
        ),
        ["mm", "v"],
    ),
    "times since 1970 and since the start": (
        pd.DataFrame({"timestamp": 1.7e9 + SECONDS, "lap": VALUES}).assign(
            elapsed_time=SECONDS, v=-VALUES
        ),
        ["lap", "v"],
    ),
}


@pytest.mark.parametrize("form", ORDINARY)
def test_an_ordinary_form_is_taken_for_no_odd_one(written, form):
    source, names = ORDINARY[form]
    assert list(read_source(written(source) if isinstance(source, str) else source)) == names


@pytest.mark.parametrize(
    ("beside", "start"), [({}, "2024-03-01T01:00Z"), ({"hour": HOURS.hour}, START)]
)
def test_the_hour_in_which_an_interval_ends_is_one_of_its_day_where_no_other_is(beside, start):
    ends = {"date": HOURS.strftime("%Y-%m-%d"), "Hour Ending": HOURS.hour + 1}
    channels = read_source(pd.DataFrame(ends | beside | {"v": VALUES}))
    check(channels["v"], start=start, interval_s=3600)


def test_a_clock_that_begins_again_leaves_no_channel_as_an_option():
    frame = pd.DataFrame({"t": [*range(N), *range(N)], "v": [*VALUES, *-VALUES], "w": 1.0})
    with pytest.raises(InputError, match="begin again") as caught:
        read_telemetry(frame)
    assert caught.value.options == ({"time": "none"},)


def test_words_that_repeat_times_are_states_on_request(refused):
    frame = pd.DataFrame({"time": TIMES.repeat(2), "a": ["on", "off"] * N, "b": ["x", "y"] * N})
    with refused("--states --series-column none"):
        read_source(frame)
    states = read_source(frame, options=Cleaning(states=True, series_column="none"))
    assert set(states) == {"a", "b"}


def test_tables_in_csv_and_parquet_are_no_parts_of_one_series(tmp_path, written, refused):
    pd.read_csv(written(PLAIN)).to_parquet(tmp_path / "b.parquet")
    with refused("a.csv and b.parquet"):
        read_source(tmp_path)


def test_series_of_words_beside_series_of_numbers_are_left_out():
    frame = pd.DataFrame({"id": ["a", "b"] * N, "time": TIMES.repeat(2)})
    frame["value"] = [word for value in VALUES for word in (str(value), "on")]
    channels = read_source(frame)
    assert list(channels) == ["a"]
    assert "series without numbers: b" in check(channels["a"]).find("columns left out").text


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


def test_hexadecimal_numbers_leave_other_columns_without_names_what_they_are(written):
    path = written(table("", SECONDS, [f"DD{k:04X}" for k in range(N)], VALUES))
    assert list(read_source(path, time="column 0", options=NO_HEADER)) == ["column 2"]


def test_whole_numbers_that_differ_are_a_channel_where_no_column_has_a_name(written):
    numbers = np.random.default_rng(0).permutation(1_000)[:N]
    channels = read_source(written(table("", numbers, VALUES)), options=NO_HEADER)
    assert list(channels) == ["column 0", "column 1"]


def test_an_option_that_is_too_long_for_a_message_is_none(refused):
    names = [f"a channel with a long name {number}" for number in range(10)]
    frame = pd.DataFrame({name: VALUES for name in names}).assign(time=TIMES)
    with refused("or other names") as found:
        read_source(pd.concat([frame, frame[names[:1]]], axis=1))
    assert found.value.options == tuple({"columns": [f"{names[0]}.{k}"]} for k in (1, 2))


def test_an_index_may_be_named_like_a_column():
    frame = framed().set_index("time", drop=False)
    assert list(read_source(frame)) == list(read_source(frame, time="time.1")) == ["v"]


def test_a_short_row_below_no_header_moves_no_value(written, refused):
    rows = table("", SECONDS, VALUES, VALUES).splitlines()
    rows[20] = rows[20].rpartition(",")[0]
    with refused("line 21"):
        read_source(written("\n".join(rows)), options=NO_HEADER)


def test_names_in_merged_cells_go_before_those_below_them(tmp_path):
    columns = [VALUES, VALUES + 1, VALUES + 2, VALUES + 3]
    path = tmp_path / "merged.csv"
    path.write_text(
        table("Time;Pump;;Fan;\n;Flow;Power;Flow;Temp", MINUTES, *columns, separator=";")
    )
    channels = read_source(path)
    assert list(channels) == ["Pump Flow", "Pump Power", "Fan Flow", "Fan Temp"]
    check(channels["Fan Flow"], VALUES + 2)


def test_quoted_numbers_of_rows_without_a_name_as_r_writes_them(tmp_path):
    path = tmp_path / "r.txt"
    rows = [
        f'"{k + 1}","{time}",{value}'
        for k, (time, value) in enumerate(zip(MINUTES, VALUES, strict=True))
    ]
    path.write_text("\n".join(['"date","v"', *rows]))
    check(one(path))


def test_a_unit_in_the_name_of_a_given_clock_holds(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table("Tid [min],v", np.arange(N), VALUES))
    check(one(path, time="Tid [min]"), start="1970-01-01T00:00Z")


def test_utc_above_the_table_is_no_other_zone(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table("# Time zone: UTC\ntime,v", stamps("%F %T"), VALUES))
    check(one(path))


def test_a_minus_sign_is_one(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table("time,v", UTC, [f"\u2212{value}" for value in VALUES]), encoding="utf-8")
    check(one(path), -VALUES)


def test_a_year_and_a_month_beside_dates_are_no_channels(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table("time,Year,Month,v", UTC, [2024] * N, [3] * N, VALUES))
    check(one(path))


def test_a_counter_and_fractions_of_a_second_are_no_signals_of_clocks_of_their_own(tmp_path):
    path = tmp_path / "bag.csv"
    fractions = [250_000_000 * (k % 4) for k in range(N)]
    header = "Time,header.seq,header.stamp.secs,header.stamp.nsecs,linear.x"
    path.write_text(table(header, UNIX + 0.5, 700 + np.arange(N), UNIX, fractions, VALUES))
    channels = read_source(path)
    check(channels["linear.x"], start=START + pd.Timedelta("500ms"))
    assert "header.stamp.nsecs" not in channels


FIRMWARE = ["2.40.55"] * N
READ_AS_THEY_ARE = {
    "words with points beside a clock": table("time,Firmware,v", UTC, FIRMWARE, VALUES),
    "several lines in a cell": table(
        "time,note,v", UTC, [*[""] * 30, '"1. open,\n2. close, wait"', *[""] * (N - 31)], VALUES
    ),
    "a last cell that names leave out": table(
        '"id","time","v"', [f'"{k}"' for k in range(1, N + 1)], UTC, VALUES, [""] * N
    ),
    "UTC in a longer line above": table("# Time zone of all times here: UTC\ntime,v", UTC, VALUES),
    "a date with an offset of something else": table(
        "time,shift_start,v", MINUTES, ["2024-02-29T22:00:00+01:00"] * N, VALUES
    ),
    "seconds and milliseconds that are no time": table(
        "time,on_s,on_ms,v", UTC, np.arange(N) % 9, 7 * np.arange(N) % 990, VALUES
    ),
}


@pytest.mark.parametrize("text", READ_AS_THEY_ARE.values(), ids=READ_AS_THEY_ARE)
def test_what_looks_like_another_form_is_read_as_it_is(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    channels = read_source(path)
    check(channels["v"])
    assert ("on_s" in channels) == ("on_s" in text)


def test_a_date_of_zeros_alone_is_bad(tmp_path, refused):
    path = tmp_path / "a.csv"
    path.write_text(table("time,v", ["00/00/0000 00:00", *stamps("20/03/%Y %H:%M")[1:]], VALUES))
    with refused("1 in all", "--drop-bad"):
        read_source(path)


def test_seconds_since_a_time_of_day_count_from_zero(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table("Time since 00:00 [s],v", SECONDS, VALUES))
    check(one(path), start="1970-01-01T00:00Z")
