"""Fits a simulator to telemetry, updates it, and reports how good it is on held-out time."""
