"""Parallel work: calls a function for many items, in processes of this machine or in Ray actors.

This package depends on neither telemetry nor files.
"""
