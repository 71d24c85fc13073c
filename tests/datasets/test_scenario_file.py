"""The scenario file: its meaning, error messages with the place of a mistake, and malicious files."""

import re
from pathlib import Path

import pytest
import yaml

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.datasets.mix import Mix, ScenarioShare, make_mix, read_mix

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
}


def written(path, content):
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    return path


def test_a_file_with_all_keys(tmp_path):
    scenarios = ScenarioShare("stuck", 0.3, (0.2, 0.9), (0, 0.5)), ScenarioShare("drift", 0.2, (1, 1), (0.25, 0.25))
    assert read_mix(written(tmp_path / "mix.yaml", GOOD)) == Mix(0.5, scenarios, 1_000, 7, 100)


def test_optional_keys_may_be_left_out(tmp_path):
    assert read_mix(written(tmp_path / "mix.yaml", "{}")) == Mix()
    mix = read_mix(written(tmp_path / "mix.yaml", {"scenarios": GOOD["scenarios"]}))
    assert mix.nominal == pytest.approx(0.5) and mix.windows is mix.seed is mix.shard is None
    assert read_mix(written(tmp_path / "mix.yaml", "windows: 10_000_000\nseed:\n")).windows == 10**7


def test_the_example_of_the_documentation_is_valid(tmp_path):
    (text,) = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    mix = read_mix(written(tmp_path / "mix.yaml", text))
    assert mix.windows and mix.seed is not None and len(mix.scenarios) > 2
    for word in (*MODES, *GOOD, *GOOD["scenarios"][0]):
        assert f"`{word}`" in DOCS.read_text(encoding="utf-8"), f"{word} is not explained"


def test_options_give_the_same_mix_as_a_file(tmp_path, refused):
    by_option = make_mix([Degraded("stuck", 0.5), Degraded("drift", 0.2, 0.0)], 0.4)
    text = "nominal: 0.4\nscenarios:\n- {mode: stuck, share: 0.3, severity: 0.5}\n- {mode: drift, share: 0.3, severity: 0.2, onset: 0}\n"
    assert read_mix(written(tmp_path / "mix.yaml", text)) == by_option
    assert make_mix([], 0.5) == Mix(1.0)
    with refused("scenarios[1].onset", "0.9995"):
        make_mix([Degraded("stuck", 0.5, 0.9995)], 0.5)


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
    "an unknown key": (changed("models", to=[{"folder": "a"}]), ["models", "no such key"]),
    "an unknown key inside": (changed("scenarios", 1, "weight", to=1), ["scenarios[2].weight"]),
    "an unknown mode": (changed("scenarios", 0, "mode", to="stick"), ["scenarios[1].mode", "stuck", "stick"]),
    "no mode": (changed("scenarios", 0, "mode", to=None), ["scenarios[1].mode"]),
    "a severity too large": (changed("scenarios", 1, "severity", to=1.5), ["scenarios[2].severity", "1.5"]),
    "a range upside down": (changed("scenarios", 0, "severity", to=[0.9, 0.2]), ["scenarios[1].severity", "lower number first"]),
    "an onset at the end": (changed("scenarios", 0, "onset", to=1), ["scenarios[1].onset"]),
    "no number": (changed("scenarios", 0, "share", to=float("nan")), ["scenarios[1].share", "nan"]),
    "true as a number": (changed("nominal", to=True), ["nominal", "True"]),
    "shares below one": (changed("nominal", to=0.4), ["add up to 1", "0.9"]),
    "too many scenarios": (
        changed("scenarios", to=[{"mode": "stuck", "share": 0, "severity": 1} for _ in range(1_001)]),
        ["scenarios", "1000"],
    ),
    "a list at the top": ([1], ["keys and values"]),
    "nothing": ("", ["keys and values"]),
    "a key twice": ("seed: 1\nseed: 2\n", ["twice", "seed", "line 1"]),
    "no YAML": ("windows: [1\nseed: 2", ["line 2"]),
    "aliases that multiply": ("a: &a [1,1,1]\nb: &b [*a,*a,*a]\nscenarios: [*b,*b]\n", ["alias", "line 2"]),
    "a tag that runs code": ("windows: !!python/object/apply:os.system ['true']\n", ["tag", "line 1"]),
    "a number without end": ("seed: " + "9" * 5_000 + "\n", ["Received"]),
    "a hexadecimal number without end": ("seed: 0x" + "f" * 5_000 + "\n", ["thousands of digits"]),
    "too deep": ("[" * 5_000, ["recursion"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_error_messages_name_the_place(name, tmp_path, refused):
    content, words = MISTAKES[name]
    with refused(*words):
        read_mix(written(tmp_path / "mix.yaml", content))


def test_files_that_cannot_be_read(tmp_path, refused):
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00a")
    (tmp_path / "large.yaml").write_text("# " + "x" * 10**6)
    for path, word in (
        ("missing.yaml", "missing.yaml"),
        ("zero\0byte", "zero\\x00byte"),
        ("bytes.yaml", "bytes"),
        ("large.yaml", "300,000"),
    ):
        with refused(word):
            read_mix(tmp_path / path)
