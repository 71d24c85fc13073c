"""Names of the noise models of the ladder. This module imports nothing, so that the command line can list the names."""

BY_OPTION = {
    "none": "none",
    "gaussian": "Gaussian",
    "autoregression": "autoregression",
    "residual windows": "residual windows",
    "matched residual windows": "matched residual windows",
    "autoregressive network": "autoregressive network",
    "paper": "GAN of the paper",
    "convolutional": "convolutional GAN",
}
"""Maps the value of an option to the name of its rung in `ladder.RUNGS`, the simplest first."""
GANS = ("paper", "convolutional")
"""Options whose rungs are GANs."""
GAN_RUNGS = tuple(BY_OPTION[option] for option in GANS)
"""Names of these rungs."""
SAVED = tuple(option for option in BY_OPTION if option not in GANS)
"""Options whose noise models can be saved."""
NETWORKS = ("autoregressive network", *GANS)
"""Options whose rungs train networks."""
BEST = "best"
"""The option with which held-out telemetry chooses a rung."""
FOLLOWERS = ("matched residual windows", "autoregressive network")
"""Options whose rungs make noise that can follow the enhanced signal."""
STREAMS = {
    "none": 0,
    "gaussian": 1,
    "autoregression": 2,
    "residual windows": 3,
    "autoregressive network": 4,
    "paper": 5,
    "convolutional": 6,
    "matched residual windows": 7,
}
"""Number of the stream of random draws of each option. A new option gets the next number, so that the draws of the others stay."""
