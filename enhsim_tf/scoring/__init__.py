"""Scores telemetry with a fitted simulator: views, the threshold of their sum, events, and lasting
departures (title and abstract of the paper).
"""
