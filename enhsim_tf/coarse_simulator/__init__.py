"""The coarse simulator (section 2.1): square waves, their fit to telemetry, and degraded modes.

This package knows telemetry, and nothing of networks, noise or detectors.
"""
