"""Names of the noise models that a fit offers. This module imports nothing, so that the command line can list them."""

CANDIDATES = ("none", "gaussian", "autoregression", "residual windows", "matched residual windows")
"""The noise models, the simplest first."""
BEST = "best"
"""The option with which held-out telemetry chooses among the candidates."""
