"""The noise (section 2.3): its extraction, the paper's GAN, the convolutional GAN, and surrogates that are fitted to it.

This package knows windows of noise, and nothing of telemetry, simulators or detectors.
"""
