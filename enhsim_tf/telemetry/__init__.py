"""Telemetry: series with times and units, sources and stores, cleaning, and windows.

This package does not depend on simulators, networks or detectors.
"""
