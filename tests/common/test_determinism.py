"""Reproducibility: bitwise on the same machine, and up to rounding with the instructions of another processor."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
# the tests themselves may run with any of these settings: the kernels are those that do not run here
OTHERS = {
    "an older processor": {"ONEDNN_MAX_CPU_ISA": "SSE41"},
    "a processor without AVX-512": {"ONEDNN_MAX_CPU_ISA": "AVX2"},
    "other kernels": {"TF_ENABLE_ONEDNN_OPTS": "0" if os.environ["TF_ENABLE_ONEDNN_OPTS"] in ("1", "true") else "1"},
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A simulator whose networks are wide enough for their sums to be rounded in many ways."""
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from tests.enhanced_simulator.test_simulator import COARSE

    from enhsim_tf.enhancer.network import build_enhancer
    from enhsim_tf.noise.surrogates import GaussianAutoregression

    noise = GaussianAutoregression([0.5], 1.0, 120)
    folder = tmp_path_factory.mktemp("models") / "volts"
    EnhancedSimulator(COARSE, build_enhancer(120, 256, seed=0), noise, interval_s=2.0, trained={"seed": 0}).save(folder)
    return folder


def generated(model, out, **environment):
    """Generates a small data set with the command in a separate process, and returns its bytes and its table."""
    command = [sys.executable, "-m", "enhsim_tf", "generate", model, "--windows", "120", "--scenario", "dropout:0.7", "--workers", "1"]
    subprocess.run([*command, "--seed", "4", "--out", out], cwd=ROOT, env=os.environ | environment, check=True, capture_output=True)
    (shard,) = out.glob("shard-*.parquet")
    return shard.read_bytes(), pd.read_parquet(shard)


@pytest.fixture(scope="module")
def here(model, tmp_path_factory):
    return generated(model, tmp_path_factory.mktemp("here") / "set")


def test_to_the_bit_on_one_machine(model, here, tmp_path):
    assert generated(model, tmp_path / "set")[0] == here[0]


@pytest.fixture(scope="module")
def elsewhere(model, tmp_path_factory):
    return {other: generated(model, tmp_path_factory.mktemp("there") / "set", **OTHERS[other]) for other in OTHERS}


@pytest.mark.parametrize("other", OTHERS)
def test_to_rounding_on_another(other, elsewhere, here):
    _, table = elsewhere[other]
    pd.testing.assert_frame_equal(table.drop(columns="window"), here[1].drop(columns="window"))  # all that is drawn is the same
    first, second = (np.stack(frame["window"]) for frame in (here[1], table))
    np.testing.assert_allclose(second, first, rtol=0, atol=2e-5 * first.std())


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the settings choose among instructions of x86")
def test_something_else_was_tried(elsewhere, here):
    """Which setting computes other bits depends on the processor, but not all of them can be what runs here."""
    assert any(there != here[0] for there, _ in elsewhere.values())
