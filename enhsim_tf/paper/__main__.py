"""`python -m enhsim_tf.paper`."""

from enhsim_tf.common.console import exit_process
from enhsim_tf.paper.command import main

if __name__ == "__main__":
    exit_process(main())
