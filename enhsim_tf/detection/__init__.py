"""Anomaly detectors, injected anomalies, thresholds and performance measures (title and abstract of the paper), on windows of telemetry."""
