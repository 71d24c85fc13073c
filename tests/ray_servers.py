"""Tests that start servers of Ray: how long that takes is not in our hands, so they run on request."""

import importlib.util
import os

import pytest

starts_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None or not os.environ.get("ENHSIM_TF_RAY"),
    reason="it starts servers of Ray, an optional extra: only where ENHSIM_TF_RAY=1",
)
