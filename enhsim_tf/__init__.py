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
    "EnhancedSimulator": "enhanced_simulator.simulator",
    "FitOptions": "enhanced_simulator.fit_options",
    "FmuSimulator": "coarse_simulator.fmu",
    "FunctionSimulator": "coarse_simulator.interface",
    "InjectOptions": "datasets.inject",
    "InputError": "common.errors",
    "ParquetStore": "telemetry.parquet_store",
    "Recording": "coarse_simulator.recording",
    "RunModel": "enhanced_simulator.runs.model",
    "RunOptions": "enhanced_simulator.runs.options",
    "ScoreOptions": "enhanced_simulator.scoring",
    "SquareWave": "coarse_simulator.square_waves",
    "SquareWaveSimulator": "coarse_simulator.square_waves",
    "Telemetry": "telemetry.series",
    "TrustedRange": "enhanced_simulator.trusted_range",
    "UpdateOptions": "enhanced_simulator.update_options",
    "build_enhancer": "enhancer.network",
    "clean": "telemetry.cleaning.clean",
    "fit_channel": "enhanced_simulator.fitting",
    "fit_run_model": "enhanced_simulator.runs.fitting",
    "from_series": "telemetry.pandas_series",
    "inject_channel": "datasets.inject",
    "load_labelled": "telemetry.telemanom",
    "read_recording": "coarse_simulator.recording_files",
    "read_source": "telemetry.sources",
    "read_telemetry": "telemetry.sources",
    "record": "coarse_simulator.recording",
    "score_channel": "enhanced_simulator.scoring",
    "score_run": "enhanced_simulator.runs.scoring",
    "series_labelled": "datasets.labelled_windows",
    "to_series": "telemetry.pandas_series",
    "update_simulator": "enhanced_simulator.updating",
}
__all__ = list(_PLACES)


def __getattr__(name: str):
    if name in _PLACES:
        return getattr(importlib.import_module(f"enhsim_tf.{_PLACES[name]}"), name)
    raise AttributeError(f"module 'enhsim_tf' has no attribute {name!r}")
