"""`python -m enhsim_tf verify`: checks a large data set."""

import argparse
from typing import TYPE_CHECKING

from enhsim_tf.common.console import tell

if TYPE_CHECKING:
    pass


def run_verify(options: argparse.Namespace) -> int:
    """Checks a large data set."""
    from enhsim_tf.datasets.generate import verify

    return verify(options.folder, tell)
