"""TensorFlow's start, training loops and fast operations. No other package imports Keras or TensorFlow directly.

This package knows arrays and networks, and nothing of telemetry.
"""
