"""The product, ML-enhanced simulation: fit, generate, score, save, load and report (sections 2 and 3).

This package joins the coarse simulator, the enhancer and the noise. It knows nothing of data sets, commands or the paper's
settings. Its two public names are imported when they are first used.
"""

from typing import Any

__all__ = ["PAPER", "EnhancedSimulator"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from enhsim_tf.enhanced_simulator import simulator

    return getattr(simulator, name)
