"""Every random draw uses a generator that is passed in, or a seed of a model or layer; none uses global state."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "enhsim_tf"
TREES = {
    path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
    for path in PACKAGE.rglob("*.py")
}

OWNERS = {"default_rng", "Generator", "SeedSequence", "BitGenerator", "PCG64"}
SEEDED = {
    "HeUniform",
    "GlorotUniform",
    "RandomNormal",
    "RandomUniform",
    "Dropout",
    "GaussianNoise",
    "shuffle",
}


def unowned_draws(tree):
    """Calls that draw random numbers from global state, or create a random object without a seed."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = (
                [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else [alias.name for alias in node.names]
            )
            found += [f"import {name}" for name in names if name == "random"]
        if not isinstance(node, ast.Call):
            continue
        name, seeded = (
            ast.unparse(node.func),
            any(keyword.arg == "seed" for keyword in node.keywords),
        )
        *path, last = name.split(".")
        if path[-2:] in (["np", "random"], ["numpy", "random"]) and (
            last not in OWNERS or (last == "default_rng" and not node.args)
        ):
            found.append(name)
        stateless = (
            seeded or last in ("split", "fold_in") or last.startswith("stateless_")
        )  # the seed is an argument
        if (path[:2] == ["tf", "random"] and not stateless) or last in (
            "set_random_seed",
            "set_seed",
        ):
            found.append(name)
        if path[-2:] == ["keras", "random"] and not (
            seeded or (last == "SeedGenerator" and node.args)
        ):
            found.append(name)
        if path and last in SEEDED and path[0] in ("keras", "tf") and not seeded:
            found.append(name)
        if (
            last in ("Dense", "Conv1D")
            and path[0] == "keras"
            and not any(keyword.arg == "kernel_initializer" for keyword in node.keywords)
        ):
            found.append(f"{name} without kernel_initializer")
    return found


def test_every_random_draw_uses_an_explicit_generator_or_seed():
    found = {module: unowned_draws(tree) for module, tree in TREES.items()}
    assert {module: draws for module, draws in found.items() if draws} == {}


DRAWS = """np.random.normal(3)
np.random.seed(0)
np.random.default_rng()
tf.random.normal((3,))
tf.random.set_seed(0)
keras.utils.set_random_seed(1)
keras.random.normal((3,))
keras.layers.Dropout(0.3)
keras.layers.Dense(3)
import random""".splitlines()


@pytest.mark.parametrize("text", DRAWS)
def test_draws_without_a_generator_or_seed_are_detected(text):
    assert unowned_draws(ast.parse(text))
