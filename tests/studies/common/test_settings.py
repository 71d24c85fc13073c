"""The settings of the studies."""

import numpy as np
import pytest

from studies.common.environments import FAMILIES, NOISES
from studies.common.noise_gallery import GALLERY
from studies.common.settings import StudyTelemetrySettings


def test_families_of_the_commands_are_those_of_the_gallery():
    assert set(FAMILIES) == set(GALLERY) and set(NOISES) < set(FAMILIES)


@pytest.mark.parametrize("noise", ["shot", "signal_dependent"])
def test_noise_of_every_process_has_the_standard_deviation_of_the_settings(noise):
    time = np.arange(200_000)
    signal = 0.5 * np.sin(2 * np.pi * time / 480) + 0.25 * np.sin(2 * np.pi * time / 120)  # of the example telemetry
    drawn = StudyTelemetrySettings(noise=noise, noise_sd=3.0).draw_noise(signal, np.random.default_rng(0))
    assert np.std(drawn) == pytest.approx(3.0, rel=0.03)


def test_an_unknown_process_is_refused(refused):
    with refused("telemetry.noise", "'pink'"):
        StudyTelemetrySettings(noise="pink").draw_noise(np.zeros(3), np.random.default_rng(0))
