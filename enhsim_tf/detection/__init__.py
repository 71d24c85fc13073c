"""Anomaly detectors, injected anomalies, thresholds and performance measures (title and abstract of the paper).

This package works on windows of telemetry. It does not depend on simulators.
"""
