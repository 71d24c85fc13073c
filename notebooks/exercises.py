"""`python -m notebooks.exercises --seed 7`: a notebook of exercises with a student's own numbers, which says what is right.

Each exercise draws its numbers from the seed. The notebook holds a slow checksum of each answer and no answer, and needs only
Python. `--answers` prints the answers of a seed, for lecturers.
"""

import argparse
import dataclasses
import hashlib
import inspect
import sys
from collections.abc import Callable
from math import comb
from pathlib import Path
from typing import Any

import nbformat
import numpy as np

from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.console import run_command
from notebooks.lesson_tools import ROOT

Values = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Exercise:
    """An exercise with a numerical answer.

    Args:
        lesson: Number of the lesson that it belongs to.
        title: Its title.
        task: What to compute, with the names of values in braces.
        draw: Draws the values.
        answer: Computes the answer from the values.
        decimals: Decimal places that are asked for; the last one may be off by one.
    """

    lesson: str
    title: str
    task: str
    draw: Callable[[np.random.Generator], Values]
    answer: Callable[..., float]
    decimals: int


def listed(values: np.ndarray, decimals: int = 2) -> list[float]:
    """Numbers as a reader sees them."""
    return [round(float(value), decimals) for value in values]


def from_choices(**choices: list[Any]) -> Callable[[np.random.Generator], Values]:
    """Draws one of the choices for each name."""
    return lambda rng: {name: values[rng.integers(len(values))] for name, values in choices.items()}


def conformal(scores: list[float], percent: int) -> float:
    """The conformal threshold: the score of rank ceil((n + 1)(1 - rate))."""
    rank = -(-(len(scores) + 1) * (100 - percent) // 100)
    return sorted(scores)[rank - 1]


def kept_by_average(width: int, period: int) -> float:
    """The share of a sine that a centred moving average keeps."""
    steps = np.arange(-(width // 2), width // 2 + 1)
    return float(np.cos(2 * np.pi * steps / period).mean())


def effective_rank(shares: list[float]) -> float:
    """The exponential of the entropy of shares."""
    return float(np.exp(-sum(share * np.log(share) for share in shares)))


def draw_shares(rng: np.random.Generator) -> Values:
    """Four shares, in hundredths, that sum to one."""
    cuts = np.sort(rng.choice(np.arange(5, 96, 5), 3, replace=False))
    return {"shares": listed(np.diff([0, *cuts, 100]) / 100)}


def area_under_curve(nominal: list[float], anomalous: list[float]) -> float:
    """The share of pairs in which the anomalous score is larger; a tie counts half."""
    pairs = [(a > n) + (a == n) / 2 for a in anomalous for n in nominal]
    return sum(pairs) / len(pairs)


def right_guesses(number: int, percent: int) -> int:
    """The smallest number of right answers that guessing reaches with at most this probability."""
    return next(
        right
        for right in range(number + 2)
        if 100 * sum(comb(number, k) for k in range(right, number + 1)) <= percent * 2**number
    )


EXERCISES = [
    Exercise(
        "00",
        "A day of alarms",
        "A detector judges {windows} independent windows a day, each with a false-alarm rate of {percent} %. What is the probability "
        "of at least one false alarm on a day without a fault?",
        from_choices(windows=[24, 36, 48, 72, 96, 144, 172], percent=[1, 2, 3]),
        lambda windows, percent: 1 - (1 - percent / 100) ** windows,
        3,
    ),
    Exercise(
        "02",
        "A square wave for a sine",
        r"A square wave of the heights $\pm{height}$ stands for the sine of amplitude 1 with the same period and zeros. What is its NRMSE?",
        from_choices(height=[0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.3]),
        lambda height: float(np.sqrt(2 * (height**2 - 4 * height / np.pi + 0.5))),
        3,
    ),
    Exercise(
        "03",
        "Count the parameters",
        "A network maps {window} samples to {window} samples by Dense layers of {first}, {second} and {window} units, with biases. How "
        "many parameters has it?",
        from_choices(window=[60, 80, 100, 120], first=[150, 200, 250], second=[300, 350, 400]),
        lambda window, first, second: (window + 1) * first + (first + 1) * second + (second + 1) * window,
        0,
    ),
    Exercise(
        "04",
        "Ridge regression by hand",
        "The inputs {x} have the targets {y}. Which weight $w$ minimises $\\sum(y-wx)^2+\\lambda w^2$ for $\\lambda={penalty}$?",
        lambda rng: {
            "x": listed(rng.uniform(-3, 3, 5), 1),
            "y": listed(rng.uniform(-3, 3, 5), 1),
            "penalty": int(rng.integers(1, 9)),
        },
        lambda x, y, penalty: float(np.dot(x, y) / (np.dot(x, x) + penalty)),
        3,
    ),
    Exercise(
        "05",
        "More than luck",
        "A reader calls {number} windows real or generated. At least how many answers must be right so that pure guessing does as well "
        "with a probability of at most {percent} %?",
        from_choices(number=[16, 20, 24, 30, 40, 50, 60], percent=[1, 2, 5]),
        right_guesses,
        0,
    ),
    Exercise(
        "08",
        "What a moving average calls noise",
        "A centred moving average of {width} samples is subtracted from a sine with a period of {period} samples. Which share of its "
        "amplitude is left?",
        from_choices(width=[9, 15, 21, 31, 41], period=[80, 100, 150, 240]),
        lambda width, period: 1 - kept_by_average(width, period),
        3,
    ),
    Exercise(
        "09",
        "Effective rank",
        "Windows vary in four directions, with the shares {shares} of the variance. What is their effective rank?",
        draw_shares,
        effective_rank,
        2,
    ),
    Exercise(
        "10",
        "Places of a filter",
        "A convolution with a filter of {width} samples moves over {window} samples in steps of {stride}, without padding. At how many "
        "places does it look?",
        from_choices(width=[12, 16, 20, 25], window=[300, 400, 450, 500], stride=[3, 4, 5]),
        lambda width, window, stride: (window - width) // stride + 1,
        0,
    ),
    Exercise(
        "11",
        "The generator's loss",
        "The discriminator gives three generated rows the probabilities {seen} of being real. What is the generator's loss?",
        lambda rng: {"seen": listed(rng.uniform(0.05, 0.95, 3))},
        lambda seen: float(-np.mean(np.log(seen))),
        3,
    ),
    Exercise(
        "12",
        "Called real",
        "A discriminator calls {real} % of real and {generated} % of generated rows by their right names. Both kinds are equally frequent. "
        "It calls a row real: with which probability is it?",
        lambda rng: {"real": int(rng.integers(52, 95)), "generated": int(rng.integers(52, 95))},
        lambda real, generated: real / (real + 100 - generated),
        3,
    ),
    Exercise(
        "13",
        "A conformal threshold",
        "Held-out nominal windows have the scores {scores}. What is the conformal threshold for {percent} % of false alarms?",
        lambda rng: {
            "scores": listed(rng.choice(np.arange(10, 400), 24, replace=False) / 100),
            "percent": [8, 12, 16, 20][rng.integers(4)],
        },
        conformal,
        2,
    ),
    Exercise(
        "10",
        "Rank by pairs",
        "Nominal windows have the scores {nominal}, anomalous ones {anomalous}. What is the AUC?",
        lambda rng: {
            "nominal": listed(rng.integers(1, 9, 5) / 10, 1),
            "anomalous": listed(rng.integers(3, 11, 4) / 10, 1),
        },
        area_under_curve,
        3,
    ),
    Exercise(
        "22",
        "Noise of the wrong size",
        "A detector scores the mean square of white noise. It learned noise of {scale} times the real standard deviation. What is the mean "
        "score of real windows, in units of the mean score of the windows that it learned?",
        from_choices(scale=[0.7, 0.8, 0.85, 0.9, 1.1, 1.2, 1.3, 1.4]),
        lambda scale: 1 / scale**2,
        2,
    ),
    Exercise(
        "31",
        "Two channels together",
        "The means of windows of two channels have mean 0, standard deviation 1 and the correlation {rho}. A window has the means {first} "
        "and {second}. What is its squared Mahalanobis distance?",
        from_choices(rho=[0.5, 0.6, 0.8, 0.9, 0.95], first=[0.5, 1.0, 1.5], second=[-1.5, -1.0, -0.5, 2.0]),
        lambda rho, first, second: (first**2 - 2 * rho * first * second + second**2) / (1 - rho**2),
        2,
    ),
]
"""Exercises for lessons of the core, and some more."""


def drawn(seed: int) -> list[Values]:
    """The values of all exercises for a seed; each has draws of its own."""
    return [
        exercise.draw(np.random.default_rng([seed, number]))
        for number, exercise in enumerate(EXERCISES, start=1)
    ]


def checksum(answer: float, decimals: int, salt: str) -> str:
    """A slow checksum of a rounded number: who wants to try all numbers computes for longer than the exercise takes."""
    units = str(round(float(answer) * 10**decimals)).encode()
    return hashlib.pbkdf2_hmac("sha256", units, salt.encode(), 50_000).hex()[:20]


def check(number: int, answer: float | None) -> None:
    """Says whether an answer is right; the last decimal place may be off by one."""
    if answer is None:
        print(f"{number}: not yet answered.")
        return
    decimals, expected = CHECKS[number]
    near = [answer + step * 10**-decimals for step in (-1, 0, 1)] if decimals else [answer]
    right = any(checksum(value, decimals, f"{SEED}/{number}") == expected for value in near)
    print(f"{number}: {'right.' if right else 'not yet.'}")


CHECKS: dict[int, tuple[int, str]] = {}  # of a written notebook
SEED = 0


def as_notebook(seed: int) -> nbformat.NotebookNode:
    """The exercises of a seed as a notebook that runs wherever Python does."""
    checks, cells = {}, []
    for number, (exercise, values) in enumerate(zip(EXERCISES, drawn(seed), strict=True), start=1):
        sought = exercise.answer(**values)
        checks[number] = exercise.decimals, checksum(sought, exercise.decimals, f"{seed}/{number}")
        places = f" ({exercise.decimals} decimal places)" if exercise.decimals else ""
        task = exercise.task
        for name, value in values.items():
            task = task.replace(f"{{{name}}}", str(value))
        text = f"**{number}. {exercise.title}** (lesson {exercise.lesson}). {task}{places}"
        cells += [
            nbformat.v4.new_markdown_cell(text),
            nbformat.v4.new_code_cell(f"answer_{number} = None\ncheck({number}, answer_{number})"),
        ]
    title = nbformat.v4.new_markdown_cell(
        f"# Exercises with the numbers of seed {seed}\n\nSet each answer to a number; its check says whether it is right. The last decimal "
        "place may be off by one."
    )
    code = "\n\n\n".join(inspect.getsource(function) for function in (checksum, check))
    held = ",\n".join(f"    {number}: {about}" for number, about in checks.items())
    tools = f"import hashlib\n\nSEED = {seed}\nCHECKS = {{\n{held},\n}}\n\n\n{code}"
    notebook = nbformat.v4.new_notebook(cells=[title, nbformat.v4.new_code_cell(tools), *cells])
    notebook.metadata["kernelspec"] = {
        "display_name": "Python 3",
        "language": "python",
        "name": "python3",
    }
    return notebook


def run(arguments: list[str] | None) -> int:
    """Parses the command line and runs the command."""
    parser = argparse.ArgumentParser(
        prog="python -m notebooks.exercises", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument("--seed", type=int, required=True, help="the student's number, from 0")
    parser.add_argument(
        "--out", type=Path, help="the notebook (default: exercises/exercises_SEED.ipynb in the clone)"
    )
    parser.add_argument("--answers", action="store_true", help="print the answers and write nothing")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        parser.error(f"Expected a seed of at least 0. Received: {options.seed}.")
    if options.answers:
        for number, (exercise, values) in enumerate(
            zip(EXERCISES, drawn(options.seed), strict=True), start=1
        ):
            print(f"{number:2} {exercise.title:36} {exercise.answer(**values):.{exercise.decimals}f}")
        return 0
    out = options.out or make_folder(ROOT / "exercises") / f"exercises_{options.seed}.ipynb"
    with replace_file(out) as temporary:
        nbformat.write(as_notebook(options.seed), temporary)
    print(out)
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Runs the command. An error of the user is reported as one line, with exit code 2."""
    return run_command(lambda: run(arguments), "interrupted; nothing was written")


if __name__ == "__main__":
    sys.exit(main())
