import numpy as np
import pytest
from numpy.random import default_rng

from studies.spacecraft.training_data import BlockBootstrap


@pytest.mark.parametrize(("samples", "block"), [(100, 10), (103, 25), (40, 40), (30, 1)])
def test_every_block_is_found_in_the_source(samples, block):
    source = np.arange(20 * samples, dtype=np.float32).reshape(
        20, samples
    )  # a value says its window and its place
    noise = BlockBootstrap(source, block).generate(50, default_rng(1))
    assert noise.shape == (50, samples) and noise.dtype == np.float32
    for row in noise.astype(int):
        follows = (np.diff(row) == 1) & (row[1:] // samples == row[:-1] // samples)
        seams = np.flatnonzero(~follows) + 1
        assert all(place % block == seams[0] % block for place in seams)
    if block == 10:
        firsts = [np.flatnonzero(np.diff(row) != 1)[0] + 1 for row in noise]
        assert len(set(firsts)) == 10  # seams fall anywhere
