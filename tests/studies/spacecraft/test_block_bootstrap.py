import numpy as np
import pytest
from numpy.random import default_rng

from studies.spacecraft.training_data import BlockBootstrap


@pytest.mark.parametrize(("samples", "block"), [(100, 10), (103, 25), (40, 40), (30, 1)])
def test_every_block_is_found_in_the_source(samples, block):
    source = np.arange(20 * samples, dtype=np.float32).reshape(20, samples)  # a value says its window and its place
    noise = BlockBootstrap(source, block).generate(50, default_rng(1))
    assert noise.shape == (50, samples) and noise.dtype == np.float32
    for row in noise.astype(int):
        follows = (np.diff(row) == 1) & (row[1:] // samples == row[:-1] // samples)
        seams = np.flatnonzero(~follows) + 1
        assert all(place % block == seams[0] % block for place in seams)
    if block == 10:
        firsts = [np.flatnonzero(np.diff(row) != 1)[0] + 1 for row in noise]
        assert len(set(firsts)) == 10  # seams fall anywhere


def test_bootstrap_keeps_the_marginal():
    source = default_rng(0).standard_t(3, (300, 200))
    noise = BlockBootstrap(source, 50).generate(2_000, default_rng(2))
    assert np.isin(noise, source.astype(np.float32)).all()
    shares = [0.25, 0.5, 0.75, 0.95]
    expected = np.quantile(source[:, 50:-50], shares)  # where each sample is in as many blocks as any other
    assert np.quantile(noise, shares) == pytest.approx(expected, abs=0.03)
