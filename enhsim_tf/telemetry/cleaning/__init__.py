"""Cleaning: from raw times and values to telemetry at a regular interval, with a report of what was repaired."""
