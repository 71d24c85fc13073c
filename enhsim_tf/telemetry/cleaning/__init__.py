"""Cleaning: turns raw times and values into telemetry at a regular interval, with a report of all
repairs.
"""
