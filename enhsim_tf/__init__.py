"""ML-enhanced simulation: realistic telemetry from a coarse simulator (Feldman 2020, arXiv 2008.12082).

The public names below are imported on first use, so `import enhsim_tf` costs milliseconds and only the rooms
that hold a network pay for TensorFlow.
"""

import importlib

__version__ = "0.1.0"

_ROOMS = {
    "Cleaned": "cleaning",
    "Cleaning": "cleaning",
    "Degraded": "simulator",
    "EnhancedSimulator": "enhanced_simulator",
    "FitOptions": "fit_options",
    "InputError": "errors",
    "NoiseGAN": "noise_gan",
    "ParquetStore": "store",
    "ScoreOptions": "scoring",
    "SquareWave": "simulator",
    "SquareWaveSimulator": "simulator",
    "Telemetry": "telemetry",
    "TrustedRange": "trusted_range",
    "build_enhancer": "enhancer",
    "clean": "cleaning",
    "extract_noise": "noise",
    "fit_channel": "fitting",
    "from_series": "sources",
    "load_labelled": "labelled",
    "read_source": "sources",
    "read_telemetry": "telemetry",
    "score_channel": "scoring",
    "series_labelled": "training_sets",
    "to_series": "sources",
}
__all__ = list(_ROOMS)


def __getattr__(name: str):
    if name in _ROOMS:
        return getattr(importlib.import_module(f"enhsim_tf.{_ROOMS[name]}"), name)
    raise AttributeError(f"module 'enhsim_tf' has no attribute {name!r}")
