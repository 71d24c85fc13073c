"""What else was tried where the second generator misses a bar: `python -m benchmarks.designs`.

Each row of the file it writes is one noise on a development seed: real noise held out, the frozen design, and the design
with one thing changed. The generators learn the true noise, so what they miss is not the enhancer's doing. The noise is
measured as the replicates of the experiment on robustness measure theirs, and trains detectors on the true waves. A row
that is there is not made again. `docs/REPORT.md` shows them all.
"""

import argparse
import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from enhsim_tf.noise_gan import NoiseGAN
    from enhsim_tf.reproduce.replicates import Replicate

ROOT = Path(__file__).parents[1]
FROZEN = "as it is"
DESIGNS = (FROZEN, "four times the iterations", "least squares loss")
NOISES = ("real noise", *DESIGNS)
KEYS = ("environment", "seed", "noise")


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.designs", description="Other trainings of the second generator.")
    parser.add_argument("--environment", action="append", help="white, autoregressive, heteroscedastic or shot (default: the first two)")
    parser.add_argument("--noise", action="append", choices=NOISES, help="these alone (default: all)")
    parser.add_argument("--seed", type=int, action="append", help="a development seed, 100 to 199 (default: 110)")
    parser.add_argument("--budget", choices=("full", "smoke"), default="full", help="smoke: tiny counts, measures nothing")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "tries.csv", help="the table (default: %(default)s)")
    parser.add_argument("--cache", type=Path, help="folder of the telemetry (default: the user's cache)")
    options = parser.parse_args(arguments)
    if options.budget == "smoke" and options.out == parser.get_default("out"):
        parser.error("--budget smoke needs another --out: tries.csv holds measurements")
    if not all(100 <= seed < 200 for seed in options.seed or ()):
        parser.error("--seed must be a development seed, 100 to 199: no design is chosen on the others")
    return options


def untrained(design: str, noise: np.ndarray, num_iterations: int, seed: int) -> tuple["NoiseGAN", int]:
    """Both networks of a design, and how many iterations it trains.

    Args:
        design: One of `DESIGNS`.
        noise: Windows to learn, shape `(windows, samples)`.
        num_iterations: Those of the frozen design.
        seed: Seed of the weights and of every draw.
    """
    import keras

    from enhsim_tf.convolutional_noise import convolutional_noise_gan

    number = 4 * num_iterations if design == "four times the iterations" else num_iterations
    gan = convolutional_noise_gan(noise, number, seed)
    if design == "least squares loss":
        gan.loss = keras.losses.MeanSquaredError()
    return gan, number


def measure(one: "Replicate", noise: str) -> dict[str, object]:
    """Trains a design and measures its noise, or measures real noise that was held out.

    Args:
        one: Whose telemetry and whose settings.
        noise: One of `NOISES`.

    Returns:
        A row: iterations of training, each measure's departure in units of its mean floor, and false alarms
        and recall of the detectors that train in a second, with this noise and with another draw of real telemetry.
    """
    from enhsim_tf import realism, robustness
    from enhsim_tf.detectors import DETECTORS
    from enhsim_tf.reproduce.replicates import QUICK_DETECTORS

    data, settings = one.experiment.data, one.settings
    chosen, draws = settings.robustness, np.random.default_rng([settings.seed, NOISES.index(noise)])

    def of(windows: dict[str, np.ndarray]) -> np.ndarray:
        return windows["target"] - windows["truth"]

    real, again, third = (of(data.windows(part, None)) for part in ("test", "train", "calibration"))
    size = min(chosen.num_windows, len(real), len(again), len(third))
    training, threshold = (data.windows("train", chosen.num_windows, f"tries, {part}") for part in ("training", "threshold"))
    number = 0
    if noise == NOISES[0]:
        generated = third[:size]
        arms = [data.windows(part, chosen.num_windows, f"tries, real, {part}")["target"] for part in ("train", "calibration")]
    else:
        learnt = of(data.windows("train", settings.second.num_windows, "tries, noise"))
        gan, number = untrained(noise, learnt, settings.adversarial.num_iterations, settings.seed)
        gan.fit(learnt, number, verbose=False)
        generated = gan.generate(size, draws)
        arms = [windows["truth"] + gan.generate(chosen.num_windows, draws) for windows in (training, threshold)]
    floor = realism.RealFloor(real[:size], again[:size], chosen.num_resplits, seed=settings.seed)
    ratios = {row.measure: row.ratio for row in floor.judge(generated).rows}
    quick = {name: DETECTORS[name] for name in QUICK_DETECTORS}
    judged = robustness.judge_arm(*arms, one.trial(chosen.num_anomalous_varied), quick, settings.seed)
    alarms, windows = (sum(row[name] for row in judged["alarms"]) for name in ("alarms", "windows"))
    recall = float(np.mean([row["recall"] for row in judged["recall"]]))
    return {"iterations": number, "false_alarms": alarms / windows, "recall": recall, **ratios}


def written(path: Path) -> list[dict[str, str]]:
    """The rows that a file holds, or none."""
    if not path.is_file():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def main(arguments: list[str] | None = None) -> int:
    """Makes the rows that are missing, and writes the file after each."""
    options = parse(arguments)
    from enhsim_tf.files import replace_file
    from enhsim_tf.reproduce.replicates import ENVIRONMENTS, Replicate
    from enhsim_tf.reproduce.settings import make_settings
    from enhsim_tf.reproduce.stages import Stages, default_cache
    from enhsim_tf.terminal import start_tensorflow, tell

    start_tensorflow()
    rows = written(options.out)
    for seed in options.seed or [110]:
        for environment in options.environment or ENVIRONMENTS[:2]:
            settings = make_settings(options.budget, seed, telemetry__noise=environment)
            one = Replicate(settings, Stages(options.cache or default_cache(), tell=tell))
            for noise in options.noise or NOISES:
                if any([row[key] for key in KEYS] == [environment, str(seed), noise] for row in rows):
                    continue
                found = measure(one, noise)
                shown = {key: format(value, ".4g") if isinstance(value, float) else value for key, value in found.items()}
                rows.append({"environment": environment, "seed": str(seed), "noise": noise, **shown})
                with replace_file(options.out) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
                    writer = csv.DictWriter(file, list(rows[-1]))
                    writer.writeheader()
                    writer.writerows(rows)
                tell(", ".join(f"{key} {value}" for key, value in rows[-1].items()))
    print(options.out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
