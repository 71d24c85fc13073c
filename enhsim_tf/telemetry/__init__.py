"""Telemetry: a series with its times and unit, where it is read from and kept, its cleaning, and its windows.

This package knows nothing of simulators, networks or detectors.
"""
