"""Reproducibility: bitwise on the same machine, and up to rounding with the instructions of another
processor.
"""

import os
import platform
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.model import Enhancer
from tests.clone import ROOT
from tests.known_simulators import of_waves

# OpenBLAS chooses the kernels of another processor; one of them may be what runs here
OTHERS = "Nehalem", "Haswell"  # an older processor, and one without AVX-512


@pytest.fixture
def model(tmp_path):
    """A simulator whose network is wide enough for its sums to be rounded in many ways."""
    rng, folder = np.random.default_rng(0), tmp_path / "volts"
    kernels = [
        (rng.standard_normal(size) / np.sqrt(size[0])).astype(np.float32)
        for size in ((120, 256), (256, 256), (256, 120))
    ]
    layers = tuple((kernel, np.zeros(kernel.shape[1], np.float32)) for kernel in kernels)
    zeros = np.zeros(1, np.float32), np.zeros(120, np.float32)
    enhancer = Enhancer("network", 120, 1, 1, *zeros, (), layers)
    waves = [SquareWaveSimulator([SquareWave(480, low=-1.0, high=1.0)])]
    of_waves(waves, 120, interval_s=2.0, enhancer=enhancer).save(folder)
    return folder


def generated(model, out, **environment):
    """Generates a small data set with the command in a separate process, and returns its bytes and
    its table.
    """
    words = (
        f"generate {model} --windows 120 --scenario dropout:0.7 --workers 1 --seed 4 --out {out}"
    )
    subprocess.run(
        [sys.executable, "-m", "enhsim_tf", *words.split()],
        cwd=ROOT,
        env=os.environ | environment,
        check=True,
        capture_output=True,
    )
    (shard,) = out.glob("shard-*.parquet")
    return shard.read_bytes(), pd.read_parquet(shard)


@pytest.mark.slow
@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"),
    reason="the settings choose among instructions of x86",
)
def test_to_rounding_on_another(model, tmp_path):
    here = generated(model, tmp_path / "here")
    elsewhere = [
        generated(model, tmp_path / kernels, OPENBLAS_CORETYPE=kernels) for kernels in OTHERS
    ]
    for _, table in elsewhere:
        # all that is drawn is the same
        pd.testing.assert_frame_equal(table.drop(columns="window"), here[1].drop(columns="window"))
        first, second = (np.stack(frame["window"]) for frame in (here[1], table))
        np.testing.assert_allclose(second, first, rtol=0, atol=2e-5 * first.std())
    assert any(there != here[0] for there, _ in elsewhere), "not all of them can be what runs here"
