"""The experiments on noise for which no generator was designed, and on the amount of telemetry that suffices for training."""
