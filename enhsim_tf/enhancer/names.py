"""Names of the candidates for the enhancer. This module imports nothing, so that the command line
can list them.
"""

COARSE, LEVEL_AND_GAIN, RIDGE, RIDGE_AND_FEATURES, NETWORK = CANDIDATES = (
    "coarse",
    "level and gain",
    "ridge",
    "ridge and random features",
    "network",
)
"""The simplest first: the coarse simulator itself; one level and one gain; ridge regression on all
coarse columns; ridge regression plus a second one on random rectified features of them, which
learns what the first leaves; the paper's network."""
BEST = "best"
"""The option with which held-out time chooses among the candidates."""
