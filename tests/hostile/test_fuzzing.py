"""Fuzzing with bad and hostile input: every input is either accepted or refused with an error of one line.

`python -m tests.fuzzing` runs the same targets for longer and guided by code coverage. Here the inputs are the same in every run,
and few enough to be tried each time.
"""

import importlib.util
import json
import random
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from enhsim_tf.common.errors import InputError
from tests.fuzzing import judge as judge_module
from tests.fuzzing.__main__ import shares
from tests.fuzzing.judge import judge
from tests.fuzzing.mutations import change_json
from tests.fuzzing.target import MAX_CHARACTERS, Target, all_of, is_good
from tests.fuzzing.targets import TARGETS

ROOT = Path(__file__).parents[2]
_INPUTS = 60  # for a target of weight 1
_SLOW = {name for name, target in TARGETS.items() if target.weight < 1}  # targets that load networks

_anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=10), inner, max_size=4),
    max_leaves=20,
)
INVENTED = {
    "bytes": st.binary(max_size=300),
    "text": st.text(st.characters(exclude_categories=[]), max_size=80).map(lambda text: text.encode("utf-8", "surrogatepass")),
    "json": _anything.map(lambda content: json.dumps(content).encode()),
}


@pytest.mark.parametrize("name", TARGETS)
def test_valid_inputs_are_accepted(name, tmp_path):
    target = TARGETS[name]
    outcomes = [judge(target.run, data, tmp_path / "work") for data in target.seeds()]
    assert outcomes[0].verdict == "accepted" and not [outcome.why for outcome in outcomes if outcome.verdict == "failed"]


@pytest.mark.parametrize("name", TARGETS)
def test_changed_inputs_are_accepted_or_refused_in_one_line(name, tmp_path):
    target, rng = TARGETS[name], random.Random(f"{name} 1")
    seeds = target.seeds()
    verdicts = set()
    for _ in range(max(10, round(_INPUTS * target.weight))):
        data = target.change(rng.choice(seeds), rng, seeds)
        outcome = judge(target.run, data, tmp_path / "work")
        assert outcome.verdict != "failed", f"{data[:300]!r}\n{outcome.why}"
        verdicts.add(outcome.verdict)
    assert "refused" in verdicts or name in (
        "manifest of a model",
        "journal of a data set",
    )  # for these targets, some content can always be read


@pytest.mark.parametrize("name", sorted(set(TARGETS) - _SLOW))
def test_invented_inputs_are_accepted_or_refused_in_one_line(name, tmp_path):
    target = TARGETS[name]

    @settings(derandomize=True, max_examples=40, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(INVENTED[target.form] | INVENTED["bytes"])
    def each(data):
        outcome = judge(target.run, data, tmp_path / "work")
        assert outcome.verdict != "failed", f"{data[:300]!r}\n{outcome.why}"

    each()


# what was found, and mended
FOUND = [
    ("format of times", b"%d.%m.%y:%M:%M:%S"),
    ("format of times", b"%Y-%n"),
    ("name of a channel", b"\xff\xff"),
    ("name of a channel", b"CON"),
    ("name of a channel", b"nul"),
    ("name of a channel", b" "),
    ("name of a channel in a store", b".b\xcb1970"),
    ("name of a channel in a store", b"x" * 230),
    ("name of a channel in a store", b"G\x00"),
    ("name of a channel in a store", b"vo\nlts"),
    ("name of a source", b"store#\xff"),
    ("address of a database", b"influxdb://b\xed\xa0\x80/m/f"),
    ("address of a database", b"influxdb://user:pass@host/\xed\xa0\x80m/f?a=b"),
    ("answer of a database", b"\ra\\b\n"),
    ("answer of a database", b"#datatype,string,long,dateTime:RFC3339,double\r\n,result,table,_time,_value\r\n,_result,0,soon,1\r\n"),
    ("answer of a database", b"#datatype,string,long,dateTime:RFC3339,double\r\n,result,table,_time,_value\r\n,_result,0\r\n"),
    ("answer of a database", b"#datatype,double\r\n,_value\r\n,1\r\n#datatype,string,string\r\n,error,reference\r\n,broke,17\r\n"),
    ("description in a database", b'{"name": ["a"]}'),
    ("description in a database", b"{}"),
    ("what pandas says of a parquet table", b'{"table": 5, "pandas": {}}'),
    ("header of an npy array", b"{'descr': '>f4', 'fortran_order': False, 'shape': (1000000000000,), }\n"),
    ("header of an npy array", b"{'descr': '|S0', 'fortran_order': False, 'shape': (1000000, 1000000), }\n"),
    ("header of an npy array", b"{'descr' '<U5', 'fortran_order': False, 'shape':,), }\n0"),
    ("header of an npy array", b"{'descr': '<f8', 0.5: False, 'shape': (60,), }\n"),
    ("header of an npy array", b"{'descr': '<U2', 'fortran_order': False, 'shape': (60,), }\n"),
    ("header of an npy array", b"{'descr': '<f8', 'fortran_order': False, 'shape': (60L,), }\n"),
    ("npy array", b"\x93NUMPY\x02\x00\x42\x00\x00\x00{'descr': '<U1', 'fortran_order': False, 'shape': (3,), }         \n" + b"\xff\xd8\xff\x00" * 3),
    ("labelled array", b"PK\x03\x04-\x00\x00\x00"),
    ("labelled array", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (60,), }" + b" " * 20 + b"("),
    ("description in a store", b'{"unit": "V", "name": "volts", "start": "1_000", "interval_s": "60.0", "offset_s": "0.0"}'),
    ("description in a store", b'{"unit": "V", "start": "", "interval_s": "60.0", "offset_s": "0.0"}'),
    ("description in a store", b'{"unit": "V", "name": "volts", "start": "", "interval_s": "nan", "offset_s": "1e300"}'),
    ("saved score npz", b"PK\x03\x04-\x00\x00\x00\x08\x00\x00\x00!\x00" + b"\xff" * 60),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data"), FOUND)
def test_fixed_failures_stay_fixed(name, data, tmp_path):
    outcome = judge(TARGETS[name].run, data, tmp_path / "work")
    assert outcome.verdict in ("accepted", "refused"), outcome.why


# the judge itself


def _raises(error):
    def run(data, folder):
        raise error

    return run


def _loops(data, folder):
    while True:
        pass


@pytest.mark.parametrize(
    ("run", "verdict"),
    [
        (lambda data, folder: None, "accepted"),
        (_raises(InputError("Expected a. Received: b.")), "refused"),
        (_raises(InputError("no such form")), "failed"),
        (_raises(ValueError("Expected a. Received: b.")), "failed"),
        (_raises(MemoryError()), "failed"),
        (_raises(SystemExit(0)), "failed"),
        (_raises(UserWarning("")), "failed"),
        (_loops, "failed"),
    ],
)
def test_the_judge_recognises_each_verdict(monkeypatch, tmp_path, run, verdict):
    monkeypatch.setattr(judge_module, "MAX_SECONDS", 0.2)
    assert judge(run, b"", tmp_path / "work").verdict == verdict


def test_a_refusal_is_seen_among_several_calls():
    good, bad = _raises(InputError("Expected a. Received: b.")), _raises(InputError("what?"))
    all_of(lambda: good(0, 0), lambda: None)
    with pytest.raises(InputError, match="a"):
        all_of(lambda: good(0, 0), lambda: good(0, 0))
    with pytest.raises(AssertionError):
        all_of(lambda: bad(0, 0), lambda: None)
    assert not any(map(is_good, ["Expected a. Received: \x1b[31m.", f"Expected a. Received: {'b' * MAX_CHARACTERS}."]))


@pytest.mark.parametrize("text", ["a\nb", "\x1b[31mred", "\u202eabc", "x" * 10_000, "\ud800", "a\x85b\u2028c\rd"])
def test_every_refusal_is_one_printable_line(text):
    line = str(InputError(f"Expected a. Received: {text}. Do c."))
    assert line.isprintable() and len(line) <= MAX_CHARACTERS and line.startswith("Expected a.") and line.endswith("Do c.")


def test_an_allocation_beyond_the_limit_is_a_failure(tmp_path):
    def refuses_late(data, folder):
        try:
            raise MemoryError
        except MemoryError:
            raise InputError("Expected a. Received: b. Do c.") from None

    def refuses(data, folder):
        raise InputError("Expected a. Received: b. Do c.")

    assert [judge(each, b"", tmp_path / "work").verdict for each in (refuses_late, refuses)] == ["failed", "refused"]


def test_changes_of_json_are_json_and_the_same_for_the_same_generator():
    data = TARGETS["manifest of a data set"].seeds()[0]
    changed = [change_json(data, random.Random(number), [data]) for number in range(200)]
    assert changed == [change_json(data, random.Random(number), [data]) for number in range(200)]
    assert len(set(changed)) > 150
    for each in changed:
        json.loads(each)


def test_every_target_gets_its_share():
    asked = shares(100_000, list(TARGETS))
    assert asked.keys() == TARGETS.keys() and sum(asked.values()) >= 100_000 and min(asked.values()) >= 200
    assert all(isinstance(target, Target) for target in TARGETS.values()) and len(TARGETS) >= 30


def test_the_command_is_guided_by_coverage(tmp_path):
    if importlib.util.find_spec("atheris") is None:
        pytest.skip("atheris is not installed: it has wheels for Python 3.11 and Linux only")
    words = ["--inputs", "600", "--only", "scenario file", "--out", tmp_path / "found.json", "--failures", tmp_path / "failures"]
    ended = subprocess.run([sys.executable, "-m", "tests.fuzzing", *map(str, words)], cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    found = json.loads((tmp_path / "found.json").read_text())["targets"]["scenario file"]
    assert found["inputs"] == found["accepted"] + found["refused"] == 600 and found["failed"] == 0
    assert found["counters"] > found["counters_at_first"] > 0 and not list((tmp_path / "failures").iterdir())


def test_the_tests_that_the_guarantees_name_exist():
    for file, test in re.findall(r"`(tests/\w+/test_\w+\.py)(?:::(\w+))?`", (ROOT / "SECURITY.md").read_text()):
        assert f"def {test or 'test_'}" in (ROOT / file).read_text(), (file, test)


def test_a_time_too_far_off_for_its_zone_is_refused(tmp_path, refused):
    import pandas as pd

    from enhsim_tf.telemetry.sources import read_source

    times = pd.DatetimeIndex(np.array([0, 60, 10**12]).view("datetime64[s]")).tz_localize("UTC").tz_convert("Europe/Berlin")
    pd.DataFrame({"time": times, "value": [1.0, 2.0, 3.0]}).to_parquet(tmp_path / "x.parquet")
    with refused("a time out of range", "row 2"):
        read_source(tmp_path / "x.parquet")
