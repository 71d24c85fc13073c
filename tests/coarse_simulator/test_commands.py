"""Traces of commands: a known effect of commands is recovered, and explains telemetry better than a square wave does."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.simulator.coarse_choice import choose_coarse
from enhsim_tf.telemetry.series import Telemetry


@pytest.fixture
def sent():
    return (np.random.default_rng(0).random((4_000, 3)) < [0.02, 0.02, 0]).astype(np.float32)


def test_the_command_and_its_decay_are_recovered(sent):
    heated = np.convolve(sent[:, 1], np.exp(-np.arange(600) / 64))[
        :4_000
    ] + 0.01 * np.random.default_rng(1).standard_normal(4_000)
    telemetry = Telemetry(heated.astype(np.float32), name="celsius")
    found = choose_coarse([telemetry], commands=sent).traces
    assert (2, 64.0) in found.chosen and 3 not in dict(found.chosen)  # the third was never sent
    expected = np.convolve(sent[:, 1], np.exp(-np.arange(4_000) / 64))[:4_000]
    np.testing.assert_allclose(
        CommandTraces([(2, 64.0)]).traces(sent)[:, 0], expected, rtol=1e-5, atol=1e-6
    )
    unrelated = choose_coarse([telemetry], commands=np.random.default_rng(2).permutation(sent))
    assert unrelated.traces is None


def test_a_command_that_was_sent_only_in_held_out_time_does_not_hide_what_another_explains():
    rng = np.random.default_rng(0)
    sent = np.stack([rng.random(2_000) < 0.02, np.arange(2_000) == 650], axis=1).astype(np.float32)
    values = np.convolve(sent[:, 0], np.exp(-np.arange(100) / 8))[
        :2_000
    ] + 0.05 * rng.standard_normal(2_000)
    values[800:812] += 5 * np.exp(
        -np.arange(12) / 8
    )  # where the held-out block ends, as the tail of the second command would
    assert (
        choose_coarse([Telemetry(values.astype(np.float32), name="celsius")], commands=sent).traces
        is not None
    )


def test_what_is_refused(sent, refused):
    with refused("at least 3 columns"):
        CommandTraces([(3, 8.0)]).traces(sent[:, :2])
    assert CommandTraces.fit(np.ones(4_000), np.zeros((4_000, 2))) is None
