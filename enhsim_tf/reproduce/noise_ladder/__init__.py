"""The experiment on noise that no generator was designed for, and on how little telemetry suffices."""
