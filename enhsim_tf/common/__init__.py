"""What every package may use: errors, files that appear whole or not at all, limits of size, the console, parallel work.

This package knows nothing of telemetry and imports none of the others.
"""
