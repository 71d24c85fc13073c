"""`python -m enhsim_tf`: telemetry of one's own, from a table to a trained simulator, training data and scores."""

from enhsim_tf.cli.main import main
from enhsim_tf.common.console import exit_process

if __name__ == "__main__":
    exit_process(main())
