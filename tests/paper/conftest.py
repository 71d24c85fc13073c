import pytest

from enhsim_tf.common.stages import Stages
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.settings import make_settings

TINY = {
    "window": 100,
    "num_samples": 20_000,
    "hidden_units": 32,
    "filters": 16,
    "rows": 60,
    "num_trees": 20,
    "fast": False,
}
TINY_OPTIONS = [
    word
    for name, value in TINY.items()
    for word in ("--set", f"{name}={'no' if value is False else value}")
]
"""The same for the command."""


def tiny_settings(**changed):
    """The whole paper with windows of 100 samples and plain Keras."""
    return make_settings("smoke", **TINY | changed)


def tiny_pipeline(cache, **changed):
    return Pipeline(tiny_settings(**changed), Stages(cache, tell=lambda line: None))


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="session")
def pipeline(cache):
    return tiny_pipeline(cache)
