"""Labelled data sets of any size: windows, series, and shards."""
