"""Names of the noise models of the ladder. This module imports nothing, so that the command line can list the names."""

BY_OPTION = {
    "none": "none",
    "gaussian": "Gaussian",
    "autoregression": "autoregression",
    "residual windows": "residual windows",
    "autoregressive network": "autoregressive network",
    "paper": "GAN of the paper",
    "convolutional": "convolutional GAN",
}
"""Maps the value of an option to the name of its rung in `ladder.RUNGS`, the simplest first."""
NETWORKS = ("autoregressive network", "paper", "convolutional")
"""Options whose rungs train networks."""
