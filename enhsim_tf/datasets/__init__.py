"""Labelled data sets of any size: windows, series, shards, and the scenario files that describe them.

This package uses fitted simulators. It does not depend on detectors or on the reproduction.
"""
