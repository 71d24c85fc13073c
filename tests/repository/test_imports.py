"""Importing the package, and every module without a network, must not import TensorFlow.

Which package may import which is declared in `pyproject.toml` and checked by `lint-imports`.
"""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "enhsim_tf"
WITH_NETWORKS = """common.backend common.training common.fused_adam common.blockwise_training common.convolution_maximum
    enhancer.network enhancer.ladder enhancer.rung_networks
    enhanced_simulator.simulator enhanced_simulator.training enhanced_simulator.fitting enhanced_simulator.choosing
    enhanced_simulator.updating
    enhanced_simulator.runs.model enhanced_simulator.runs.fitting enhanced_simulator.runs.residuals enhanced_simulator.runs.saving""".split()
NOT_TRIED = ("paper", "__main__")


def modules_without_networks():
    paths = (path.relative_to(PACKAGE).with_suffix("") for path in sorted(PACKAGE.rglob("*.py")))
    names = [".".join(path.parts).removesuffix(".__init__") for path in paths]
    found = [name for name in names if name.split(".")[0] not in NOT_TRIED and name not in (*WITH_NETWORKS, "__init__")]
    return [*found, "paper.settings", "paper.telemetry", "paper.square_wave"]


def test_modules_without_networks_import_no_tensorflow():
    modules = [f"enhsim_tf.{name}" for name in modules_without_networks()]
    assert len(modules) > 60
    script = (
        f"import sys\nfor module in {modules}:\n    __import__(module)\n    assert not {{'tensorflow', 'keras'}} & set(sys.modules), module"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_public_names_resolve_to_their_objects():
    import enhsim_tf

    assert {"EnhancedSimulator", "build_enhancer", "InputError"} <= set(enhsim_tf.__all__)
    for name in enhsim_tf.__all__:
        value = getattr(enhsim_tf, name)
        assert value.__name__ == name and value is getattr(importlib.import_module(value.__module__), name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = enhsim_tf.nothing


def test_the_simulator_is_found_in_its_package():
    from enhsim_tf.enhanced_simulator import EnhancedSimulator, simulator

    assert EnhancedSimulator is simulator.EnhancedSimulator
    with pytest.raises(ImportError):
        from enhsim_tf.enhanced_simulator import nothing  # noqa: F401
