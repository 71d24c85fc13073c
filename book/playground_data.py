"""The data of the playground, `book/playground/data.js`, made from the paper's pipeline by
`python -m book --playground`.

The page computes in the browser what `enhsim_tf` computes in Python: it adds noise to clean
windows, learns four views of them, sets a threshold, and judges real windows. This module gives it
the windows, the weights of the generator, and the arrays that the views have learnt.
"""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.paper.claims import ONSET
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.scoring.views import Subspace

TRAINING, JUDGED = 150, 100  # windows that set thresholds, and real ones that are judged
PATTERN = 16  # directions of the generator's noise that the vote's classifier looks at
COMPONENTS = 20  # of windows with noise, as in the paper's detector
FITTED_ON = 1_000  # windows that give the directions
MOST_STEPS = 32_767  # of int16, in which windows and directions are stored
SIGNALS = ("coarse", "enhanced", "real")
LARGEST = 1_000_000  # bytes of the file


def directions_of(windows: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """The mean of windows and their first principal components, `(samples,)` and `(number,
    samples)`.
    """
    mean = windows.mean(axis=0, dtype=np.float64)
    _, vectors = np.linalg.eigh(np.cov(windows, rowvar=False))
    return mean, vectors.T[::-1][:number]


def collect(pipeline: Pipeline) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What the page needs of a pipeline.

    Args:
        pipeline: The paper's pipeline; what it has not trained yet, it trains.

    Returns:
        The values of the example, and arrays by name.
    """
    settings = pipeline.settings
    training = pipeline.windows("train", TRAINING, "playground")
    fitted = pipeline.windows("train", FITTED_ON, "playground, directions")
    judged = pipeline.windows("test", JUDGED, "playground")
    arrays = {
        "enhanced": pipeline.enhance(training["coarse"]),
        "real": training["target"],
        "judged": judged["target"],
        "training_time": settings.interval * window_times(pipeline, "train", training["start"]),
        "judged_time": settings.interval * window_times(pipeline, "test", judged["start"]),
    }
    clean = {
        "coarse": fitted["coarse"],
        "enhanced": pipeline.enhance(fitted["coarse"]),
        "real": fitted["target"],
    }
    for name in SIGNALS:
        view = Subspace().fit(clean[name][:, :, None].astype(np.float64))
        # what the view computes with
        arrays[f"{name}_directions"] = np.vstack([view._mean, view._components])
    rng = pipeline.draw("playground, noise")
    noises = {
        "gaussian": settings.noise_sd * rng.standard_normal(clean["enhanced"].shape),
        "gan": pipeline.generate_noise(FITTED_ON, rng),
        "residuals": np.roll(clean["real"] - clean["enhanced"], -1, axis=0),
    }
    for name, noise in noises.items():
        learnt = directions_of(clean["enhanced"] + noise, COMPONENTS)
        arrays[f"{name}_directions"] = np.vstack(learnt)
    arrays["pattern"] = np.vstack(directions_of(noises["gan"], PATTERN))
    for number, weights in enumerate(pipeline.generator.get_weights()):
        arrays[f"generator_{number}"] = weights.astype(np.float32)
    size = settings.orbit_amplitude + settings.rotation_amplitude
    values = {
        "seed": settings.seed,
        "window": settings.window,
        "interval": settings.interval,
        "waves": [
            [settings.orbit_period, settings.orbit_amplitude],
            [settings.rotation_period, settings.rotation_amplitude],
        ],
        "levels": [-size, size],
        "onset": int(ONSET * settings.window),
        "noise_sd": settings.noise_sd,
        "latent": settings.latent,
        "latent_scale": settings.latent_scale,
        "activation": settings.generator_activation,
        "epsilon": float(pipeline.generator.layers[1].epsilon),
    }
    return values, arrays


def window_times(pipeline: Pipeline, part: str, starts: np.ndarray) -> np.ndarray:
    """The numbers of the first samples of windows in the whole series, float64 of shape
    `(windows,)`.
    """
    return pipeline.parts[part].first + starts.astype(np.float64)


def pack(name: str, array: np.ndarray) -> dict[str, Any]:
    """An array as the page reads it: weights and times as they are, others in whole steps."""
    unit = 1.0
    if not name.startswith("generator_") and not name.endswith("_time"):
        unit = float(np.abs(array).max()) / MOST_STEPS
        array = np.round(array / unit).astype("<i2")
    return {
        "type": array.dtype.name,
        "unit": unit,
        "shape": array.shape,
        "base64": base64.b64encode(np.ascontiguousarray(array).tobytes()).decode(),
    }


def write(pipeline: Pipeline, path: Path) -> int:
    """Writes the file and returns its size in bytes.

    Raises:
        ValueError: If it would be larger than `LARGEST`.
    """
    values, arrays = collect(pipeline)
    lines = [
        f"  {json.dumps(name)}: {json.dumps(pack(name, array))}" for name, array in arrays.items()
    ]
    text = (
        "// Made by `python -m book --playground`; not for reading.\n"
        f"const VALUES = {json.dumps(values)};\n"
        "const PACKED = {\n" + ",\n".join(lines) + "\n};\n"
    )
    if len(text) > LARGEST:
        raise ValueError(f"Expected at most {LARGEST:,} bytes. Received: {len(text):,}.")
    with replace_file(path) as temporary:
        temporary.write_text(text, encoding="ascii")
    return len(text)


def read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Reads the file as `collect` returns it."""
    values, packed = path.read_text(encoding="ascii").split("const PACKED = ")
    arrays = {}
    for name, each in json.loads(packed.rstrip(";\n")).items():
        raw = np.frombuffer(base64.b64decode(each["base64"]), each["type"])
        arrays[name] = raw.reshape(each["shape"]).astype(np.float64) * each["unit"]
    return json.loads(values.partition("const VALUES = ")[2].rstrip(";\n")), arrays
