"""`enhsim-tf verify`: verifies a large data set."""

import argparse

from enhsim_tf.common.console import tell
from enhsim_tf.common.errors import counted
from enhsim_tf.datasets.generate import find_problems, num_shards, read_manifest


def run_verify(options: argparse.Namespace) -> int:
    """Verifies a large data set against its manifest, prints one line for each problem, and returns
    the exit code.
    """
    code = 0
    for line in find_problems(options.folder):
        tell(line)
        code = 2
    if not code:
        settings = read_manifest(options.folder)["settings"]
        tell(
            f"{counted(settings['windows'], 'window')} in "
            f"{counted(num_shards(settings), 'shard')}, all intact"
        )
    return code
