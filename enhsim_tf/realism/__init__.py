"""Measures of how close generated data are to real data, each with the value that real data reach against real data.

This package knows windows, and nothing of where they come from.
"""
