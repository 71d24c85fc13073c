"""Compares variants of the convolutional GAN where it misses a target: `python -m benchmarks.designs`.

Each row of the resulting file belongs to one noise and one development seed. The noise is held-out real noise, noise of the
final design, or noise of the design with one change. The generators are trained on the true noise, so that errors of the
enhancer have no effect. The noise is evaluated as in the replicates of the robustness experiment, and detectors are trained on
the true waves with this noise. Existing rows are not computed again. `docs/REPORT_TABLES.md` shows all rows.
"""

import argparse
import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.reproduce.__main__ import NOISES as ENVIRONMENTS
from enhsim_tf.reproduce.publish.report import designs_of
from enhsim_tf.reproduce.publish.wording import AS_IT_IS, DEVELOPMENT_SEEDS, REAL_NOISE

if TYPE_CHECKING:
    from enhsim_tf.keras_tools.backend import keras
    from enhsim_tf.noise.gan import NoiseGAN
    from enhsim_tf.reproduce.robustness.replicate import Replicate

ROOT = Path(__file__).parents[1]
LONGER, LEAST_SQUARES, TAILS, MAXIMUM = (
    "four times the iterations",
    "least squares loss",
    "heavier-tailed latent series",
    "the paper's discriminator",
)
DESIGNS = (AS_IT_IS, LONGER, LEAST_SQUARES, TAILS, MAXIMUM)
_FROM_TO = f"{DEVELOPMENT_SEEDS[0]} to {DEVELOPMENT_SEEDS[-1]}"
KEYS = ("environment", "seed", "noise")
"""Columns that identify a row."""


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parses the options of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.designs", description="Other trainings of the second generator.")
    parser.add_argument("--environment", action="append", choices=ENVIRONMENTS, help="these alone (default: all)")
    parser.add_argument("--noise", action="append", choices=(REAL_NOISE, *DESIGNS), help="these alone (default: all)")
    parser.add_argument("--seed", type=int, action="append", help=f"a development seed, {_FROM_TO} (default: 110)")
    parser.add_argument("--budget", choices=("full", "smoke"), default="full", help="smoke: tiny counts, measures nothing")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "tries.csv", help="the table (default: %(default)s)")
    parser.add_argument("--cache", type=Path, help="folder of the telemetry (default: the user's cache)")
    options = parser.parse_args(arguments)
    if options.budget == "smoke" and options.out == parser.get_default("out"):
        parser.error("--budget smoke needs another --out: tries.csv holds measurements")
    if not all(seed in DEVELOPMENT_SEEDS for seed in options.seed or ()):
        parser.error(f"--seed must be a development seed, {_FROM_TO}: no design is chosen on the others")
    return options


def untrained(design: str, noise: np.ndarray, num_iterations: int, seed: int) -> tuple["NoiseGAN", int]:
    """Builds the untrained networks of a design, and returns them with the number of training iterations.

    Args:
        design: One of `DESIGNS`.
        noise: Training windows, shape `(windows, samples)`.
        num_iterations: Number of iterations of the final design.
        seed: Seed for the initial weights and for all random numbers in training.
    """
    from enhsim_tf.keras_tools.backend import keras
    from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan
    from enhsim_tf.noise.discriminator import build_discriminator

    number = 4 * num_iterations if design == LONGER else num_iterations
    gan = convolutional_noise_gan(noise, number, seed)
    if design == LEAST_SQUARES:
        gan.loss = keras.losses.MeanSquaredError()
    elif design == TAILS:
        gan.generator = heavy_tailed(gan.generator, len(gan.latent.slow_samples))
    elif design == MAXIMUM:
        gan.discriminator = build_discriminator(noise.shape[1], seed=seed)
        settings = gan.discriminator_optimizer.get_config()
        gan.discriminator_optimizer = keras.optimizers.Adam.from_config(settings)  # one optimizer cannot change its variables
        gan.discriminator_optimizer.build(gan.discriminator.trainable_variables)
    return gan, number


def heavy_tailed(generator: "keras.Model", num_slow: int, weight: float = 0.2) -> "keras.Model":
    """Replaces the normal distribution of a generator's white-noise channels by Tukey's h distribution, z exp(h z²/2).

    Args:
        generator: Model whose input has the shape `(rows, samples, channels)`, with the slow channels last.
        num_slow: Number of slow channels, which remain normally distributed.
        weight: Parameter h of the distribution. Moments of order 1/h and above are infinite.
    """
    from enhsim_tf.keras_tools.backend import keras

    normal = keras.Input(generator.input_shape[1:])
    white, slow = normal[:, :, :-num_slow], normal[:, :, -num_slow:]
    heavy = white * keras.ops.exp(weight / 2 * white * white)
    return keras.Model(normal, generator(keras.ops.concatenate([heavy, slow], axis=2)))


class Bench:
    """Training data and evaluation data for all designs, in one environment and with one seed.

    Args:
        one: Replicate of the robustness experiment, which provides the telemetry and the settings.
    """

    def __init__(self, one: "Replicate"):
        self.settings, data = one.settings, one.experiment.data
        chosen = self.settings.robustness
        self.floor, self.held_out = one.floor()
        self.learnt = one.true_noise("train", self.settings.second.num_windows, "tries, noise")
        # windows for the training of detectors, and windows for their thresholds
        self.waves = [data.windows("train", chosen.num_windows, f"tries, {part}")["truth"] for part in ("training", "threshold")]
        self.telemetry = [data.windows(part, chosen.num_windows, f"tries, real, {part}")["target"] for part in ("train", "calibration")]
        self.trial = one.trial(chosen.num_anomalous_varied)

    def measure(self, noise: str) -> dict[str, object]:
        """Trains a design and evaluates its noise, or evaluates held-out real noise.

        Args:
            noise: `REAL_NOISE` or one of `DESIGNS`.

        Returns:
            A row: the number of training iterations, the mean false-alarm rate and recall of the fast detectors after training
            on telemetry with this noise, and the departure of each realism measure in units of its mean floor.
        """
        from enhsim_tf.detection import evaluation
        from enhsim_tf.detection.registry import DETECTORS
        from enhsim_tf.reproduce.robustness.replicate import QUICK_DETECTORS

        number, generated, arms = 0, self.held_out, self.telemetry
        if noise != REAL_NOISE:
            gan, number = untrained(noise, self.learnt, self.settings.adversarial.num_iterations, self.settings.seed)
            gan.fit(self.learnt, number, verbose=False)
            draws = np.random.default_rng([self.settings.seed, 1 + DESIGNS.index(noise)])
            generated = gan.generate(len(self.held_out), draws)
            arms = [waves + gan.generate(len(waves), draws) for waves in self.waves]
        ratios = {row.measure: row.ratio for row in self.floor.evaluate(generated).rows}
        quick = {name: DETECTORS[name] for name in QUICK_DETECTORS}
        judged = evaluation.evaluate_arm(*arms, self.trial, quick, self.settings.seed)
        alarms, windows = (sum(row[name] for row in judged["alarms"]) for name in ("alarms", "windows"))
        recall = float(np.mean([row["recall"] for row in judged["recall"]]))
        return {"iterations": number, "false_alarms": alarms / windows, "recall": recall, **ratios}


def main(arguments: list[str] | None = None) -> int:
    """Computes the missing rows, and writes the file after each row."""
    options = parse(arguments)
    from enhsim_tf.common.atomic_files import replace_file
    from enhsim_tf.common.console import tell
    from enhsim_tf.reproduce.robustness.replicate import Replicate
    from enhsim_tf.reproduce.settings import make_settings
    from enhsim_tf.reproduce.stages import Stages, default_cache

    rows = designs_of(options.out)
    for seed in options.seed or [110]:
        for environment in options.environment or ENVIRONMENTS:
            kept = {row["noise"] for row in rows if (row["environment"], row["seed"]) == (environment, str(seed))}
            missing = [noise for noise in options.noise or (REAL_NOISE, *DESIGNS) if noise not in kept]
            if not missing:
                continue
            settings = make_settings(options.budget, seed, telemetry__noise=environment)
            bench = Bench(Replicate(settings, Stages(options.cache or default_cache(), tell=tell)))
            for noise in missing:
                found = {key: format(value, ".4g") for key, value in bench.measure(noise).items()}
                rows.append(dict(zip(KEYS, (environment, str(seed), noise), strict=True)) | found)
                with replace_file(options.out) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
                    writer = csv.DictWriter(file, list(rows[-1]))
                    writer.writeheader()
                    writer.writerows(rows)
                tell(", ".join(f"{key} {value}" for key, value in rows[-1].items()))
    print(options.out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
