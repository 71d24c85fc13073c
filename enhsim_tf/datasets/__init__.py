"""Labelled data sets of any size: windows, series, shards, and the scenario files that describe them."""
