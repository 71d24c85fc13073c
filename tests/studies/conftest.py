"""Fixtures of the tests of studies."""

import pytest


@pytest.fixture
def narrow_networks(monkeypatch):
    """Every enhancer has 64 units in each hidden layer instead of 3,200."""
    from enhsim_tf.enhancer import network

    wide = network.build_enhancer

    def narrow(window: int, *ignored, seed: int = 0, **named):
        return wide(window, 64, seed=seed)

    monkeypatch.setattr(network, "build_enhancer", narrow)
