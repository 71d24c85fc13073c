"""Names of the noise models that a fit offers. This module imports nothing, so that the command line can list them."""

NONE, RESIDUAL_WINDOWS, MATCHED = NOISES = ("none", "residual windows", "matched residual windows")
