"""Every random draw uses a generator that is passed in, or a seed of a model or layer; none uses
global state.
"""

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
    """Calls that draw random numbers from global state, or create a random object without a
    seed.
    """
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and any(alias.name == "random" for alias in node.names):
            found.append("import random")
        if not isinstance(node, ast.Call):
            continue
        name, keywords = ast.unparse(node.func), {keyword.arg for keyword in node.keywords}
        module, _, last = name.rpartition(".")
        is_seeded = "seed" in keywords or last in ("split", "fold_in", "SeedGenerator")
        of_keras = module.startswith(("keras", "tf"))
        if (
            (module in ("np.random", "numpy.random") and last not in OWNERS)
            or (last in OWNERS and not node.args)
            or (
                module in ("tf.random", "keras.random")
                and not is_seeded
                and "stateless" not in last
            )
            or last in ("set_random_seed", "set_seed")
            or (last in SEEDED and of_keras and not is_seeded)
            or (last in ("Dense", "Conv1D") and of_keras and "kernel_initializer" not in keywords)
        ):
            found.append(name)
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
