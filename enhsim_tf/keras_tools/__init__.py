"""TensorFlow's start-up, training loops and fast operations for the networks of sections 2.2 and 2.3 of the paper.

All other packages import Keras and TensorFlow from here. This package does not depend on telemetry.
"""
