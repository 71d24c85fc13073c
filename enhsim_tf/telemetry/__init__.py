"""Telemetry: series with times and units, sources and stores, cleaning, and windows."""
