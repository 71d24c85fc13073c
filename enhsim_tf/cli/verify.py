"""`python -m enhsim_tf verify`: verifies a large data set."""

import argparse

from enhsim_tf.common.console import tell


def run_verify(options: argparse.Namespace) -> int:
    """Verifies a large data set against its manifest and returns the exit code.

    Args:
        options: Parsed options of `verify`.
    """
    from enhsim_tf.datasets.generate import verify

    return verify(options.folder, tell)
