"""One run of the paper in a process of its own: `python -m studies.readings.one READING ROUNDING
SEED BUDGET CACHE TABLE`.
"""

import sys
from pathlib import Path

import pandas as pd

from enhsim_tf.common.console import tell
from enhsim_tf.common.stages import Stages
from enhsim_tf.paper.claims import CLAIMS
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.settings import make_settings
from studies.common.measurements import measured
from studies.readings.run import COLUMNS, READINGS, Run


def measure(run: Run, budget: str, cache: Path) -> pd.DataFrame:
    """The measurements of all claims in one run; training goes on beyond the paper's iterations for
    the columns alone.

    Args:
        run: The run.
        budget: `smoke` or `full`.
        cache: Folder of cached stages.
    """
    rounds = {} if run.reading in COLUMNS else {"rounds": 1}
    pipeline = Pipeline(
        make_settings(budget, seed=run.seed, **rounds, **READINGS[run.reading]),
        Stages(cache, tell=tell),
    )
    return measured(run, CLAIMS, pipeline)


if __name__ == "__main__":
    reading, rounding, seed, budget, cache, table = sys.argv[1:]
    measure(Run(reading, rounding, int(seed)), budget, Path(cache)).to_parquet(table, index=False)
