"""What is generated does not depend on how much of it is generated at a time."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.simulator import simulator as module
from tests.known_simulators import of_waves


@pytest.mark.parametrize("mode", [None, "drift", "stuck"])
def test_generated_windows_do_not_depend_on_the_chunks(mode, monkeypatch):
    waves = [SquareWaveSimulator([SquareWave(period_s=period, low=-0.5, high=0.5)]) for period in (10.0, 17.0)]
    simulator, scenario = of_waves(waves, 24), mode and Degraded(mode)
    whole = simulator.generate(23, scenario, seed=5)
    monkeypatch.setattr(module, "_CHUNK_VALUES", 4 * 24 * 2)
    assert [len(chunk) for chunk, _ in simulator.generate_labelled_chunks(23, scenario, seed=5)] == [4] * 5 + [3]
    np.testing.assert_allclose(simulator.generate(23, scenario, seed=5), whole, atol=1e-6)
    if mode is None:
        noise = simulator.noise.generate(23, np.random.default_rng([5, 1]))
        np.testing.assert_allclose(whole, simulator.generate_clean(23, seed=5) + noise, atol=1e-6)
    assert np.abs(whole - simulator.generate(23, scenario, seed=6)).max() > 0.01
