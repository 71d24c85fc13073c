"""The noise (section 2.3 of the paper): extraction, the paper's GAN, a convolutional GAN, an autoregressive network, resampled residuals,
and classical noise models as baselines.

This package works on windows of noise. It does not depend on telemetry, simulators or detectors.
"""
