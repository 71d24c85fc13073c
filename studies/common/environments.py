"""The kinds of noise that studies run with, by name, without slow imports."""

import argparse
from typing import Any

NOISES = ("white", "autoregressive", "heteroscedastic", "shot")
FAMILIES = (
    *NOISES, "fractional", "bernoulli", "one_over_f", "interference", "telegraph", "quantised", "bursts", "heavy_tails", "loudness",
    "signal_dependent",
)  # fmt: skip


def environment_option(names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """The option `--environment` of a study with these kinds of noise."""
    return {"--environment": {"choices": names, "help": "run with this kind of noise only (default: all)"}}


def environments(options: argparse.Namespace, names: tuple[str, ...]) -> tuple[str, ...]:
    """The kinds of noise that `--environment` asks for."""
    return names if options.environment is None else (options.environment,)
