"""The scenario file: its meaning, error messages with the place of a mistake, and malicious files."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.scenario_file import Mix, ModelShare, ScenarioShare, make_mix, read_mix

DOCS = Path(__file__).parents[2] / "docs" / "large_data_sets.md"
GOOD = {
    "windows": 1_000,
    "seed": 7,
    "shard": 100,
    "nominal": 0.5,
    "scenarios": [
        {"mode": "stuck", "share": 0.3, "severity": [0.2, 0.9], "onset": [0, 0.5]},
        {"mode": "drift", "share": 0.2, "severity": 1},
    ],
    "models": [{"folder": "a", "share": 0.25}, {"folder": "b/volts", "name": "second", "share": 0.75}],
}


def written(path, content):
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    return path


def test_a_file_with_all_keys(tmp_path):
    scenarios = ScenarioShare("stuck", 0.3, (0.2, 0.9), (0, 0.5)), ScenarioShare("drift", 0.2, (1, 1), (0.25, 0.25))
    models = ModelShare("a", "a", 0.25), ModelShare("second", "b/volts", 0.75)
    assert read_mix(written(tmp_path / "mix.yaml", GOOD)) == Mix(0.5, scenarios, models, 1_000, 7, 100)


def test_optional_keys_may_be_left_out(tmp_path):
    assert read_mix(written(tmp_path / "mix.yaml", "{}")) == Mix()
    some = {"scenarios": GOOD["scenarios"], "models": [{"folder": "a"}, {"folder": "b"}, {"folder": "./c/"}]}
    mix = read_mix(written(tmp_path / "mix.yaml", some))
    assert mix.nominal == pytest.approx(0.5) and mix.num_windows is mix.seed is mix.shard is None
    assert mix.models == tuple(ModelShare(name, name, 1 / 3) for name in "abc")
    assert read_mix(written(tmp_path / "mix.yaml", "windows: 10_000_000\nseed:\n")).num_windows == 10**7


def test_the_example_of_the_documentation_is_valid(tmp_path):
    (text,) = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    mix = read_mix(written(tmp_path / "mix.yaml", text))
    assert mix.num_windows and mix.seed is not None and len(mix.scenarios) > 2 and len(mix.models) > 1
    for word in (*MODES, *GOOD, *GOOD["models"][1], *GOOD["scenarios"][0]):
        assert f"`{word}`" in DOCS.read_text(encoding="utf-8"), f"{word} is not explained"


def test_options_give_the_same_mix_as_a_file(tmp_path):
    by_option = make_mix([Degraded("stuck", 0.5), Degraded("drift", 0.2, 0.0)], 0.4)
    text = "nominal: 0.4\nscenarios:\n- {mode: stuck, share: 0.3, severity: 0.5}\n- {mode: drift, share: 0.3, severity: 0.2, onset: 0}\n"
    assert read_mix(written(tmp_path / "mix.yaml", text)) == by_option
    assert make_mix([], 0.5) == Mix(1.0)


def changed(*path, to):
    """Returns the valid content with one value replaced."""
    content = yaml.safe_load(yaml.safe_dump(GOOD))
    *before, last = path
    inner = content
    for key in before:
        inner = inner[key]
    inner[last] = to
    return content


MISTAKES = {
    "an unknown key": (changed("window", to=5), ["at the top", "window"]),
    "an unknown key inside": (changed("scenarios", 1, "weight", to=1), ["scenarios[2]", "weight"]),
    "a key of half a character": ('windows: 1\n"\\ud800": 1\n', ["at the top", "ud800"]),
    "such a key inside": (changed("models", 0, "\ud800", to=1), ["models[1]", "ud800"]),
    "such a folder": (changed("models", 0, "folder", to="\ud800"), ["models[1].folder", "ud800"]),
    "such a mode": (changed("scenarios", 1, "mode", to="\ud800"), ["scenarios[2].mode", "ud800"]),
    "a key that is no text": (changed("scenarios", 1, 5, to=1), ["scenarios[2]", "5"]),
    "a mapping as a number": (changed("scenarios", 1, "severity", to={0: 1}), ["at scenarios[2].severity in", "{0: 1}"]),
    "an unknown mode": (changed("scenarios", 0, "mode", to="stick"), ["scenarios[1].mode", "stuck", "stick"]),
    "no mode": (changed("scenarios", 0, "mode", to=None), ["scenarios[1].mode", "nothing"]),
    "no severity": (changed("scenarios", 1, "severity", to=None), ["scenarios[2].severity"]),
    "a severity too large": (changed("scenarios", 1, "severity", to=1.5), ["scenarios[2].severity", "1.5"]),
    "a range too long": (changed("scenarios", 0, "severity", to=[0, 0.5, 1]), ["scenarios[1].severity"]),
    "a range upside down": (changed("scenarios", 0, "severity", to=[0.9, 0.2]), ["scenarios[1].severity", "lower first"]),
    "a range of text": (changed("scenarios", 0, "severity", to=[0, "high"]), ["scenarios[1].severity[2]", "high"]),
    "an onset at the end": (changed("scenarios", 0, "onset", to=1), ["scenarios[1].onset"]),
    "no number": (changed("scenarios", 0, "share", to=float("nan")), ["scenarios[1].share", "nan"]),
    "true as a number": (changed("nominal", to=True), ["nominal", "True"]),
    "text as a number": (changed("nominal", to="half"), ["nominal", "half"]),
    "shares below one": (changed("nominal", to=0.4), ["add up to 1", "0.9"]),
    "shares above one": (changed("scenarios", 0, "share", to=0.9), ["add up to 1", "1.6"]),
    "shares of models": (changed("models", 0, "share", to=0.3), ["models", "add up to 1"]),
    "no windows": (changed("windows", to=0), ["windows"]),
    "half a window": (changed("windows", to=0.5), ["windows"]),
    "too many windows": (changed("windows", to=10**10 + 1), ["windows", "10,000,000,000"]),
    "a negative seed": (changed("seed", to=-1), ["seed"]),
    "a shard too large": (changed("shard", to=10**8), ["shard"]),
    "scenarios that are no list": (changed("scenarios", to={"mode": "stuck"}), ["scenarios", "list"]),
    "a scenario that is text": (changed("scenarios", 0, to="stuck"), ["scenarios[1]", "stuck"]),
    "too many scenarios": (changed("scenarios", to=[1] * 1_001), ["scenarios", "1,000"]),
    "too many models": (changed("models", to=[{"folder": str(number)} for number in range(21)]), ["models", "20"]),
    "two models of one name": (changed("models", 1, "name", to="a"), ["models[2].name"]),
    "a folder elsewhere": (changed("models", 0, "folder", to="../a"), ["models[1].folder", "inside"]),
    "a folder at the root": (changed("models", 0, "folder", to="/etc"), ["models[1].folder", "inside"]),
    "a name of control characters": (changed("models", 1, "name", to="a\nb"), ["models[2].name", "printable"]),
    "a list at the top": ([1], ["keys and values"]),
    "nothing": ("", ["keys and values", "nothing"]),
    "a key twice": ("seed: 1\nseed: 2\n", ["twice", "seed", "line 1"]),
    "no YAML": ("windows: [1\nseed: 2", ["line 2"]),
    "an alias": ("a: &a 1\nb: *a\n", ["alias", "line 1"]),
    "aliases that multiply": ("a: &a [1,1,1]\nb: &b [*a,*a,*a]\nscenarios: [*b,*b]\n", ["alias"]),
    "a tag that runs code": ("windows: !!python/object/apply:os.system ['true']\n", ["tag", "line 1"]),
    "a harmless tag": ("seed: !!int 3\n", ["tag"]),
    "a date that is none": ("seed: 2001-99-99\n", ["month"]),
    "a number without end": ("seed: " + "9" * 5_000 + "\n", ["Received"]),
    "a hexadecimal number without end": ("seed: 0x" + "f" * 5_000 + "\n", ["thousands of digits"]),
    "zero bytes": ("seed: \x00\n", ["mix.yaml"]),
    "too deep": ("[" * 50, ["too deeply nested"]),
    "too many": ("[" + "1," * 30_000 + "]", ["too many or too deeply nested"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_error_messages_name_the_place(name, tmp_path, refused):
    content, words = MISTAKES[name]
    with refused(*words):
        read_mix(written(tmp_path / "mix.yaml", content))


def test_pydantic_is_loaded_by_who_reads_a_file_and_nobody_else():
    code = "import sys, enhsim_tf.cli.main, enhsim_tf.cli.generate_many, enhsim_tf.datasets.generate; print({'pydantic', 'yaml'} & set(sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], cwd=DOCS.parents[1], capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == ("set()\n", "")


def test_files_that_cannot_be_read(tmp_path, refused):
    with refused("missing.yaml"):
        read_mix(tmp_path / "missing.yaml")
    with refused(str(tmp_path)):
        read_mix(tmp_path)
    with refused("zero\\x00byte"):
        read_mix("zero\0byte")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00a")
    with refused("bytes.yaml"):
        read_mix(tmp_path / "bytes.yaml")
    (tmp_path / "large.yaml").write_text("# " + "x" * 10**6)
    with refused("1,000,000"):
        read_mix(tmp_path / "large.yaml")


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.dates() | st.sampled_from(["stuck", "a", 0.5]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5) | st.sampled_from(list(GOOD)), inner, max_size=3),
    max_leaves=6,
)
PLACES = [("windows",), ("scenarios",), ("scenarios", 0), ("scenarios", 0, "mode"), ("scenarios", 1, "severity"), ("scenarios", 0, "onset")]
PLACES += [("models",), ("models", 1), ("models", 0, "folder"), ("models", 1, "name"), ("nominal",), ("seed",), ("shard",), ("other",)]


def read_or_refuse(path):
    """Reads a file, which must give a mix or an error message of one line."""
    try:
        assert isinstance(read_mix(path), Mix)
    except InputError as error:
        assert len(str(error).splitlines()) == 1 and str(error).startswith("Expected ") and "Received: " in str(error)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.sampled_from(PLACES), JUNK)
def test_any_value_at_any_place_is_read_or_refused(tmp_path_factory, place, junk):
    read_or_refuse(written(tmp_path_factory.getbasetemp() / "junk.yaml", changed(*place, to=junk)))


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.binary(max_size=60) | st.text("[]{}:-,&*!|>'\"%@#?\n\t 01.eaxn_<=~", max_size=60).map(str.encode))
@example(b"<<: {a: 1}\n")
@example(b"? [a, b]\n: 1\n")
@example(b"%YAML 9.9\n---\na: 1\n")
@example(b"a: 1\n---\nb: 2\n")
@example(b"=: 1\n")
@example(b"seed: 1:99:99\n")
@example(b"seed: 0b\nshard: 0_\nnominal: ._\n")
def test_any_bytes_are_read_or_refused(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "bytes.yaml"
    path.write_bytes(content)
    read_or_refuse(path)


LARGE = {
    "a text of many words": "a: " + "x " * 499_000,
    "many keys": "\n".join(f"k{number}: 1" for number in range(9_000)),
    "questions in questions": "? " * 400_000,
    "braces in braces": "{" * 900_000,
}


@pytest.mark.parametrize("name", LARGE)
def test_large_files_are_read_or_refused(name, tmp_path):
    read_or_refuse(written(tmp_path / "mix.yaml", LARGE[name]))
