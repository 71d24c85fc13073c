"""A command that makes a data set without networks. The tests interrupt it, kill it, limit its
resources and start it twice.

Its simulator is a coarse one with white noise, so that it starts in a second.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator  # noqa: E402
from enhsim_tf.common.console import run_command  # noqa: E402
from enhsim_tf.datasets import generate  # noqa: E402
from enhsim_tf.datasets.labelled_windows import Plan, ShardMaker  # noqa: E402
from enhsim_tf.datasets.places import ScenarioRange  # noqa: E402
from tests.known_simulators import of_waves  # noqa: E402

COARSE = SquareWaveSimulator(
    [
        SquareWave(480, low=-0.5, high=0.5),
        SquareWave(120, phase=0.21, duty=0.3, low=-0.25, high=0.25),
    ]
)
WINDOW, INTERVAL_S = 60, 2.0
SCENARIOS = (ScenarioRange("stuck", (0.2, 0.9), (0.0, 0.5)), ScenarioRange("gain_loss", (0.5, 0.5)))


def plain(noise_sd=0.1, **others):
    """A simulator of the coarse signal and white noise, without a network."""
    return of_waves([COARSE], WINDOW, noise_sd, INTERVAL_S, **others)


class PlainMaker(ShardMaker):
    """Makes shards with a plain simulator, and sleeps in between."""

    delay_s = 0.0

    @property
    def simulator(self):
        time.sleep(self.delay_s)
        return plain()


class SlowMaker(PlainMaker):
    delay_s = 0.03


def plan(num_windows=1_000, shard=50, seed=3, scenarios=SCENARIOS, nominal=0.5, checksum="0" * 64):
    nominal = nominal if scenarios else 1.0
    return Plan(
        scenarios,
        nominal,
        Path("nowhere"),
        checksum,
        WINDOW,
        INTERVAL_S,
        ("volts",),
        seed,
        num_windows,
        shard,
    )


def die_at_thirteen(number):
    """Work that always kills its process at one item."""
    return number if number != 13 else os._exit(9)


def threads_and_square(number):
    """Work that reports how it is executed."""
    return number**2, os.getpid(), os.environ["TF_NUM_INTRAOP_THREADS"], "tensorflow" in sys.modules


def meet(folder, num_processes, number):
    """Work that waits until the given number of processes have started."""
    (folder / str(os.getpid())).touch()
    while len(os.listdir(folder)) < num_processes:
        time.sleep(0.01)
    return number


def threads_of(number):
    """Thread counts of a process: those of TensorFlow and of linear algebra."""
    import threadpoolctl

    return os.environ["TF_NUM_INTRAOP_THREADS"], {
        library["num_threads"] for library in threadpoolctl.threadpool_info()
    }


def refuse(number):
    """Work that raises an InputError."""
    from enhsim_tf.common.errors import InputError

    raise InputError(f"Expected another number. Received: {number}.")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("out")
    parser.add_argument("--limit", type=int, help="bytes that a file may have")
    parser.add_argument(
        "--user", type=int, help="whose rights to have, once everything is imported"
    )
    options = parser.parse_args()
    if options.user:
        os.seteuid(options.user)
    if options.limit:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (options.limit, options.limit))
    generate.ShardMaker = SlowMaker

    def run():
        generate.generate_data_set(options.out, plan(), 2)
        return 0

    return run_command(run, "interrupted; what was finished is kept")


if __name__ == "__main__":
    np.seterr(all="raise")
    sys.exit(main())
