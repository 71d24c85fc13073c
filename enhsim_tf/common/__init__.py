"""Utilities for all other packages: errors, atomic file writing, size limits, console output and parallel work.

This package does not depend on telemetry and imports none of the other packages.
"""
