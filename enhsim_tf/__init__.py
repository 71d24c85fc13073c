"""ML-enhanced simulation: realistic telemetry from a coarse simulator (Feldman 2020, arXiv
2008.12082).

The public names below are imported on first use, so `import enhsim_tf` takes milliseconds and only
modules that use a network import TensorFlow.
"""

import importlib

__version__ = "0.2.0"

_PLACES = {
    "Cleaned": "telemetry.cleaning.clean",
    "Cleaning": "telemetry.cleaning.clean",
    "Clock": "telemetry.series",
    "CoarseSimulator": "coarse.interface",
    "Degraded": "coarse.degraded",
    "EnhancedSimulator": "simulator.simulator",
    "FitOptions": "fitting.options",
    "FmuSimulator": "coarse.fmu",
    "FunctionSimulator": "coarse.interface",
    "InjectOptions": "datasets.options",
    "InputError": "common.errors",
    "Telemetry": "telemetry.series",
    "ScoreOptions": "scoring.options",
    "Scorer": "scoring.scorer",
    "SquareWave": "coarse.square_waves",
    "SquareWaveSimulator": "coarse.square_waves",
    "TelemetryDetector": "scoring.estimator",
    "TrustedRange": "scoring.trusted_range",
    "clean": "telemetry.cleaning.clean",
    "events_table": "scoring.score",
    "example": "datasets.example",
    "fit": "fitting.fit",
    "inject": "datasets.inject",
    "join_channels": "telemetry.joining",
    "read_recording": "coarse.recording_files",
    "read_source": "telemetry.sources",
    "read_telemetry": "telemetry.sources",
    "record": "coarse.interface",
    "score": "scoring.score",
    "series_labelled": "datasets.labelled_series",
    "to_series": "telemetry.pandas_series",
    "update": "fitting.update",
}
__all__ = list(_PLACES)


def __getattr__(name: str):
    if name in _PLACES:
        return getattr(importlib.import_module(f"enhsim_tf.{_PLACES[name]}"), name)
    raise AttributeError(f"module 'enhsim_tf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PLACES])
