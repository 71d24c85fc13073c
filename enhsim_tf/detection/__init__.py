"""Detectors, injected anomalies, thresholds and the measures that judge them (title and abstract of the paper).

This package knows windows, and nothing of simulators.
"""
