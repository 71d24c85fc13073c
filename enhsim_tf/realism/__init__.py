"""Measures of how realistic generated noise and telemetry are, each with its real-vs-real baseline (evaluates sections 2.2 and 2.3).

This package works on arrays of windows. It does not depend on how they were obtained.
"""
