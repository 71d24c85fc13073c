"""ML-enhanced simulation: realistic telemetry from a coarse simulator (Feldman 2020, arXiv 2008.12082).

The public names below are imported on first use, so `import enhsim_tf` takes milliseconds and only
modules that use a network import TensorFlow.
"""

import importlib

__version__ = "0.1.0"

_PLACES = {
    "Cleaned": "telemetry.cleaning.clean",
    "Cleaning": "telemetry.cleaning.clean",
    "CoarseSimulator": "coarse_simulator.interface",
    "Degraded": "coarse_simulator.degraded",
    "EnhancedSimulator": "simulator.simulator",
    "FitOptions": "simulator.options",
    "FmuSimulator": "coarse_simulator.fmu",
    "FunctionSimulator": "coarse_simulator.interface",
    "InjectOptions": "datasets.places",
    "InputError": "common.errors",
    "Recording": "coarse_simulator.recording",
    "ScoreOptions": "simulator.options",
    "Scorer": "simulator.scoring",
    "SquareWave": "coarse_simulator.square_waves",
    "SquareWaveSimulator": "coarse_simulator.square_waves",
    "Telemetry": "telemetry.series",
    "TelemetryDetector": "simulator.estimator",
    "TrustedRange": "simulator.trusted_range",
    "clean": "telemetry.cleaning.clean",
    "events_table": "simulator.scoring",
    "fit": "simulator.fitting",
    "inject": "datasets.inject",
    "join_channels": "simulator.joint",
    "read_recording": "coarse_simulator.recording_files",
    "read_source": "telemetry.sources",
    "record": "coarse_simulator.recording",
    "score": "simulator.scoring",
    "series_labelled": "datasets.labelled_series",
    "to_series": "telemetry.pandas_series",
    "update": "simulator.updating",
}
__all__ = list(_PLACES)


def __getattr__(name: str):
    if name in _PLACES:
        return getattr(importlib.import_module(f"enhsim_tf.{_PLACES[name]}"), name)
    raise AttributeError(f"module 'enhsim_tf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PLACES])
