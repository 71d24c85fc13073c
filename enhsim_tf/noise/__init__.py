"""Noise (section 2.3 of the paper): extraction, the paper's GAN, and simple models: Gaussian, autoregression, resampled residual windows.

This package works on windows of noise. It does not depend on telemetry, simulators or detectors.
"""
