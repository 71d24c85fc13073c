"""Importing the package, and every module without a network, must not import TensorFlow.

Which package may import which is declared in `pyproject.toml` and checked by `lint-imports`.
"""

import importlib

import numpy as np
import pytest

from tests.clone import ROOT, python

PACKAGE = ROOT / "enhsim_tf"
WITH_NETWORKS = "common.backend", "common.fast_keras"
NOT_TRIED = ("paper", "own_channel", "__main__")


def modules_without_networks():
    paths = (path.relative_to(PACKAGE).with_suffix("") for path in sorted(PACKAGE.rglob("*.py")))
    names = [".".join(path.parts).removesuffix(".__init__") for path in paths]
    found = set(names) - {*WITH_NETWORKS, "__init__"}
    found = {name for name in found if name.split(".")[0] not in NOT_TRIED}
    return [*found, "paper.settings", "paper.telemetry", "paper.square_wave"]


def run(script, **options):
    """Runs Python in a new process, which must end well, and returns its standard error."""
    done = python(script, **options)
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_modules_without_networks_import_no_tensorflow():
    modules = [f"enhsim_tf.{name}" for name in modules_without_networks()]
    assert len(modules) > 60
    run(
        f"import sys\nfor module in {modules}:\n    __import__(module)\n    assert not "
        f"{{'tensorflow', 'keras'}} & set(sys.modules), module"
    )


def test_a_fit_generated_data_scores_and_anomalies_need_no_tensorflow(tmp_path):
    noise = 0.1 * np.random.default_rng(0).standard_normal((1_500, 2))
    values = np.sin(np.arange(1_500) / 6)[:, None] + noise
    np.savetxt(tmp_path / "x.csv", values, delimiter=",", header="a,b", comments="")
    commands = [
        # a linear map: no network is tried
        "fit x.csv --out models --window 64 --num-windows 60",
        "generate models --windows 9 --scenario stuck:1 --out x.parquet",
        "score models x.csv --out scores.csv",
        "inject x.csv --kinds ramp --out labelled",
    ]
    run(
        f"import sys\nfrom enhsim_tf.__main__ import main\nfor words in {commands}:\n"
        "    assert main(words.split()) == 0\n"
        "    assert not {'tensorflow', 'keras'} & set(sys.modules), words",
        cwd=tmp_path,
    )


def test_a_missing_source_run_or_model_is_said_before_pandas_is_imported(tmp_path):
    (tmp_path / "x.csv").write_text("a\n1\n")
    commands = [
        "fit y.csv --out models",
        "fit x.csv y.csv --out models",
        "fit x.csv --coarse y.csv --out models",
        "score models x.csv --out scores.csv",
    ]
    said = run(
        "import sys\nfrom enhsim_tf.__main__ import main\n"
        f"assert [main(words.split()) for words in {commands}] == [2] * 4\n"
        "assert 'pandas' not in sys.modules",
        cwd=tmp_path,
    )
    assert said.count("error: ") == 4
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]


def test_public_names_resolve_to_their_objects():
    import enhsim_tf

    assert {"EnhancedSimulator", "fit", "score", "update", "InputError"} <= set(enhsim_tf.__all__)
    for name in enhsim_tf.__all__:
        value = getattr(enhsim_tf, name)
        assert value.__name__ == name and value is getattr(
            importlib.import_module(value.__module__), name
        )
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = enhsim_tf.nothing
