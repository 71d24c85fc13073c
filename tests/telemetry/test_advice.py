"""The advice of refusals works: a robot that follows it, for at most three steps, has the source
read right, or reads at the end why it cannot be and what to do.
"""

from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.sources import read_source
from tests.telemetry.robot import follow, in_folder

SHARED = Path(__file__).parents[3] / "shared"
CASES = [
    (path, line)
    for folder in ("field_cases", "field_cases_2")
    for path in sorted((SHARED / folder).glob("*/command.txt"))
    for line in path.read_text().splitlines()
    if "enhsim_tf " in line and " score " not in line and "inject out1" not in line
]
# what one of the endings must be: channels, samples of the first, its parts, start and interval
DAY = "2024-03-01T00:00:00+00:00"
RIGHT = {
    "ampm_dotted": (["Valor"], 400, DAY, 300.0),
    "bagpy_secs_nsecs": (["twist.linear.x"], 400, "2024-03-01T00:00:00.003999949+00:00", 0.1),
    "biologic_mpt": (["Ewe/V", "<I>/mA"], 600, "1970-01-01T00:00:00+00:00", 10.0),
    "blackbox_explorer": (["gyroADC[0]"], 400, "1970-01-01T00:01:01+00:00", 0.001),
    "clock_jumps_back": (["spo2", "pulse"], 7_200, None, 1.0),
    "date_slash_time": (["v"], 400, None, 60.0),
    "doy_compact_daily": (["volts"], 600, DAY, 86_400.0),
    "energyplus_24h": (["ZONE:Mean Air Temperature [C](Hourly)"], 480, None, 1.0),
    "excel_serial": (["volts"], 600, DAY, 60.0),
    "fluke_overload": (["primary"], 400, DAY, 1.0),
    "pge_green_button": (["USAGE"], None, None, 3_600.0),
    "px4_ulog2csv": (["voltage_v"], 400, "1970-01-01T00:00:53.214499500+00:00", 0.1),
    "ragged_short": (["temperature", "pressure"], 400, "1970-01-01T00:00:00+00:00", 1.0),
    "short_rows_end": (["a", "b", "c"], 399, DAY, 60.0),
    "states_only": (["armed", "heater"], 400, DAY, 60.0),
    "swat": (["FIT101"], 600, DAY, 1.0),
    "time_per_signal": (["CoolantTemp [degC]"], 80, "1970-01-01T00:00:00+00:00", 0.5),
    "time_s_time_us": (["position", "current"], 400, DAY, 0.04),
    "trailing_summary": (["volts"], 600, DAY, 60.0),
    "xlsx_sheets": (["Pressure (bar)"], 400, DAY, 60.0),
}
NOT_READ = {"mavlogdump_header_only": "Give a file with values", "npy_transposed": "transposed"}


def is_right(ending, wanted):
    names, samples, start, interval_s = wanted
    if ending.channels is None or not set(names) <= set(ending.channels):
        return False
    telemetry = ending.channels[names[0]].telemetry
    return (
        samples in (None, len(telemetry))
        and start in (None, telemetry.start)
        and telemetry.interval_s == pytest.approx(interval_s)
    )


@pytest.mark.skipif(not CASES, reason="the field cases are not here")
@pytest.mark.parametrize(
    ("path", "line"), CASES, ids=[f"{path.parent.name}-{n}" for n, (path, _) in enumerate(CASES)]
)
def test_the_advice_leads_to_the_right_telemetry_or_says_why_not(path, line):
    endings, name = in_folder(path.parent, line), path.parent.name
    if name in NOT_READ:
        assert all(NOT_READ[name] in ending.message for ending in endings)
        return
    assert any(ending.channels for ending in endings), endings
    if name in RIGHT:
        assert any(is_right(ending, RIGHT[name]) for ending in endings), endings


ROWS = [f"{number},{number + 0.5},{number + 0.25}" for number in range(50)]


def test_no_value_is_put_in_the_wrong_place(written):
    """Lines with fewer cells: left out on request, with the values of all others where they are."""
    rows = [*ROWS[:20], "20,93426", *ROWS[21:]]
    (ending,) = follow([str(written("\n".join(["time,a,b", *rows]) + "\n"))])
    assert ending.options == ("--drop-bad",)
    for name, off in (("a", 0.5), ("b", 0.25)):
        values = ending.channels[name].telemetry.values[:, 0]
        np.testing.assert_allclose(values, np.arange(50) + off)
        assert ending.channels[name].report.find("ragged lines").places == ("line 22",)


@pytest.mark.parametrize("end", ["\n", ""])
def test_a_quote_that_does_not_end_hides_no_lines(written, end):
    rows = [*ROWS[:20], '"' + ROWS[20], *ROWS[21:]]
    with pytest.raises(InputError, match="line 22 has 1"):
        read_source(written("\n".join(["time,a,b", *rows]) + end))
