"""The enhanced simulator: fit, generate, score, save, load and report (sections 2 and 3 of the paper).

This package combines the coarse simulator, the enhancer and the noise. It does not depend on the packages for data
sets, commands and the reproduction. Its public name is imported lazily, at its first use.
"""

from typing import Any

__all__ = ["EnhancedSimulator"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from enhsim_tf.enhanced_simulator import simulator

    return getattr(simulator, name)
