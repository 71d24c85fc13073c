"""The coarse simulator (section 2.1 of the paper): square waves, their fit to telemetry, and degraded modes.

This package depends on telemetry, but not on networks, noise or detectors.
"""
