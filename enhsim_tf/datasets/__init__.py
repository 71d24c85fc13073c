"""Labelled data sets of any size: windows, series, shards, and the scenario files that describe them.

This package uses fitted simulators. It knows nothing of detectors or of the reproduction.
"""
