"""Runs the author's code on our noise and measures what it generates by our functions."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from enhsim_tf.common.measures import autocorrelation
from enhsim_tf.common.stages import Stages, save_arrays
from enhsim_tf.paper import noise
from enhsim_tf.paper.claims import CLAIMS
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.settings import Settings, make_settings
from studies.common.measurements import add_runs, measured

EXTRACTED = "extracted"
WHITE = "white"
AVERAGES = {EXTRACTED: "centred", WHITE: "none"}
SPANS = {"4": 4.0, "2 pi": 2 * np.pi}
SIDE = 5
"""His `train` shows generated rows at SIDE * SIDE iterations; his demo has 5, too."""
CONFIGURATION = {"update": "two of 200"}
"""What his code does otherwise than the paper's text."""
MEASURED = ("C5", "C6")
"""Claims that his code touches: it has neither an enhancer nor a detector."""
TABLE = "measurements.parquet"
ENVIRONMENT = {
    "TF_USE_LEGACY_KERAS": "1",
    "TF_CPP_MIN_LOG_LEVEL": "2",
    "TF_XLA_FLAGS": "--tf_xla_auto_jit=2 --tf_xla_cpu_global_jit",
}
"""Of his process. XLA is a compiler: his loop takes .65 instead of .83 CPU seconds an iteration."""


class Run(NamedTuple):
    """One run of his code.

    Args:
        noise: `EXTRACTED` or `WHITE`.
        span: One of `SPANS`.
        iterations: Iterations of training.
        seed: The seed.
    """

    noise: str
    span: str
    iterations: int
    seed: int

    @property
    def words(self) -> str:
        """The run without its seed, in words."""
        return f"{self.noise} noise, span {self.span}, {self.iterations:,} iterations"


KEYS = list(Run._fields)


def runs(seeds: int, seeds_of_demo: int, seeds_of_long: int) -> list[Run]:
    """The runs in their order: both kinds of noise with one seed before the next seed, then the
    span and then the iterations of his demo.

    Args:
        seeds: Seeds of both kinds of noise.
        seeds_of_demo: Seeds with the span 2 pi.
        seeds_of_long: Seeds with 5,000 iterations.
    """
    planned = [Run(kind, "4", 1_000, seed) for seed in range(seeds) for kind in AVERAGES]
    planned += [Run(EXTRACTED, "2 pi", 1_000, seed) for seed in range(seeds_of_demo)]
    return planned + [Run(EXTRACTED, "4", 5_000, seed) for seed in range(seeds_of_long)]


def settings_of(run: Run, budget: str) -> Settings:
    """The settings of this project with which a run of ours is his configuration."""
    changed = CONFIGURATION | {"latent_scale": SPANS[run.span], "average": AVERAGES[run.noise]}
    lasting = {} if budget == "smoke" else {"iterations": run.iterations}
    return make_settings(budget, seed=run.seed, rounds=1, **changed, **lasting)


class AuthorPipeline(Pipeline):
    """The pipeline with his GAN in place of ours.

    Args:
        settings: All settings.
        stages: Keeps the results.
        code: His file.
    """

    def __init__(self, settings: Settings, stages: Stages, code: Path):
        super().__init__(settings, stages)
        self.code = code

    @property
    def gan_settings(self) -> dict[str, Any]:
        """What the trained GAN depends on."""
        checksum = hashlib.sha256(self.code.read_bytes()).hexdigest()
        return super().gan_settings | {"code": checksum}

    def _train_gan(self, folder: Path) -> None:
        settings = self.settings
        series = self.noise_series("train")
        data = folder / "series.npy"
        out = folder / "author.npz"
        np.save(data, series)
        numbers = (
            settings.seed,
            settings.latent_scale,
            settings.iterations,
            settings.record_every,
            SIDE,
        )
        arguments = ["-m", "studies.author_code.train", self.code, data, *numbers, out]
        environment = os.environ | ENVIRONMENT
        subprocess.run([sys.executable, *map(str, arguments)], env=environment, check=True)
        data.unlink()
        found = dict(np.load(out))
        out.unlink()

        generator = noise.build_generator(settings)
        weights = [name for name in found if name.startswith("weight_")]
        generator.set_weights([found[f"weight_{at}"] for at in range(len(weights))])
        # the same network in both versions of Keras
        ours = generator.predict(found["latent"], verbose=0)
        np.testing.assert_allclose(ours, found["generated"], atol=1e-5)
        generator.save_weights(folder / "generator.weights.h5")

        step = settings.iterations / SIDE**2
        shown = [1 + epoch for epoch in range(settings.iterations) if epoch % step == 0]
        every = settings.record_every
        save_arrays(
            folder,
            {
                "iteration": np.arange(every, settings.iterations + 1, every),
                "accuracy_real": found["real_acc"],
                "accuracy_generated": found["fake_acc"],
                "loss_real": found["real_loss"],
                "loss_generated": found["fake_loss"],
                "followed_at": shown,
                "sd": [np.std(rows) for rows in found["followed"]],
                "lag_one": [autocorrelation(rows, 1)[1] for rows in found["followed"]],
                "real_sd": np.std(series),
                "real_lag_one": autocorrelation(self.noise_windows("train"), 1)[1],
            },
        )


def collect(
    planned: list[Run], code: Path, budget: str, cache: Path, folder: Path, tell: Callable
) -> pd.DataFrame:
    """Does the runs that the table in the folder does not have yet, and returns the table."""

    def measure(run: Run) -> pd.DataFrame:
        claims = [claim for claim in CLAIMS if claim.id in MEASURED]
        stages = Stages(cache, tell=tell)
        return measured(run, claims, AuthorPipeline(settings_of(run, budget), stages, code))

    return add_runs(planned, measure, folder / TABLE, tell)
