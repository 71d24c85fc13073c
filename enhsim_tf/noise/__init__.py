"""Noise models (section 2.3 of the paper) on windows of noise: Gaussian, autoregression, resampled residual windows."""
