"""Parallel work: a function is called for many items by processes of this machine or by Ray.

This package knows neither telemetry nor files.
"""
