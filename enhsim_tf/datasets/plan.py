"""What a large data set is, in full: its mix, its models by their checksums, its seed, and how it is cut into shards.

A plan is made without loading a network. Two plans with the same `key` make the same shards.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.scenario_file import MOST_MODELS, MOST_WINDOWS, Mix, ModelShare
from enhsim_tf.enhanced_simulator.safe_loading import read_description
from enhsim_tf.enhanced_simulator.saving import MANIFEST, check_saved, settings_of

FORMAT = "enhsim_tf.datasets.generate/1"
_SHARD = 8_192  # windows a shard, where they have up to 512 samples
_SHARD_VALUES = 2**22  # values a shard, where the windows are longer
MOST_VALUES = 2**26  # values of a shard: 256 MiB, which a worker holds at once
_MOST_SHARDS = 2_000_000
_VERSIONS = ("tensorflow", "keras", "numpy", "pyarrow")


@dataclasses.dataclass(frozen=True)
class Model:
    """A saved simulator as a part of a plan.

    Args:
        name: What its windows are labelled with.
        folder: Where it stands; no part of what the data set is.
        share: Its share of the windows.
        sha256: Checksum of its manifest, which holds those of its files.
        window: Samples of a window.
        interval_s: Sampling interval in seconds.
    """

    name: str
    folder: Path
    share: float
    sha256: str
    window: int
    interval_s: float


@dataclasses.dataclass(frozen=True)
class Plan:
    """A data set that is to be made.

    Args:
        mix: Scenarios and their shares.
        models: Its simulators, of one window.
        seed: The master seed.
        num_windows: Windows in all.
        shard: Windows a shard; the last may have fewer.

    Raises:
        InputError: If the models do not fit together, or a number is beyond what a data set can have.
    """

    mix: Mix
    models: tuple[Model, ...]
    seed: int
    num_windows: int
    shard: int

    def __post_init__(self):
        first = self.models[0]
        for model in self.models:
            if model.window != first.window or abs(model.interval_s / first.interval_s - 1) > 1e-3:
                raise InputError(
                    f"Expected models of one window and interval: {first.window} samples of {first.interval_s:g} s, as {first.name!r}. "
                    f"Received: {model.window} samples of {model.interval_s:g} s in {model.name!r}."
                )
        if not 1 <= self.num_windows <= MOST_WINDOWS:
            raise InputError(f"Expected from 1 to {MOST_WINDOWS:,} windows. Received: {self.num_windows:,}.")
        if self.shard * self.window > MOST_VALUES:
            raise InputError(f"Expected shards of at most {MOST_VALUES // self.window:,} such windows. Received: shard: {self.shard:,}.")
        if self.num_shards > _MOST_SHARDS:
            raise InputError(f"Expected at most {_MOST_SHARDS:,} shards. Received: {self.num_shards:,}. Make them larger with `shard:`.")

    @property
    def window(self) -> int:
        """Samples of a window."""
        return self.models[0].window

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.num_windows // self.shard)

    def rows_of(self, shard: int) -> int:
        """Windows of a shard."""
        return min(self.shard, self.num_windows - shard * self.shard)

    def settings(self) -> dict[str, Any]:
        """Everything that the content depends on, in plain JSON types; no path is among it."""
        return {
            "windows": self.num_windows,
            "shard": self.shard,
            "seed": self.seed,
            "window": self.window,
            "interval_s": self.models[0].interval_s,
            "nominal": self.mix.nominal,
            "scenarios": [
                {"mode": part.mode, "share": part.share, "severity": list(part.severity), "onset": list(part.onset)}
                for part in self.mix.scenarios
            ],
            "models": [{"name": model.name, "share": model.share, "sha256": model.sha256} for model in self.models],
            "versions": {name: importlib.metadata.version(name) for name in _VERSIONS},
        }

    @property
    def key(self) -> str:
        """Checksum of the settings but the number of windows: shards of equal key, number and size are equal to the bit."""
        return key_of(self.settings())


def key_of(settings: Mapping[str, Any]) -> str:
    """The `Plan.key` of a plan with these settings."""
    others = {name: value for name, value in settings.items() if name != "windows"}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode()).hexdigest()


def plan_of(mix: Mix, folder: str | os.PathLike, seed: int, num_windows: int) -> Plan:
    """The plan of a mix.

    Args:
        mix: What is mixed; one that names no models has one, in `folder` itself.
        folder: The folder of the models.
        seed: The master seed.
        num_windows: Windows in all.

    Raises:
        InputError: If a model is missing or damaged, or if they do not fit together.
    """
    folder = Path(folder).absolute()
    shares = mix.models or (ModelShare(folder.name, ".", 1.0),)
    if len(shares) > MOST_MODELS:
        raise InputError(f"Expected at most {MOST_MODELS} models. Received: {len(shares)}.")
    models = tuple(_model_of(share, folder / share.folder) for share in shares)
    return Plan(mix, models, seed, num_windows, mix.shard or max(1, min(_SHARD, _SHARD_VALUES // models[0].window)))


def _model_of(share: ModelShare, folder: Path) -> Model:
    """Looks at a saved simulator without loading it: its checksums, its window, its interval."""
    check_saved(folder)
    interval_s = settings_of(folder).get("interval_s")
    if type(interval_s) not in (int, float) or not 0 < interval_s <= sys.float_info.max:
        raise InputError(f"Expected interval_s above 0 in settings.json. Received: {str(interval_s)[:40]} in {folder}.")
    return Model(share.name, folder, share.share, sha256(folder / MANIFEST), _window_of(folder), float(interval_s))


def _window_of(folder: Path) -> int:
    """Samples of a window: the width of the enhancer's input, as its file describes it."""
    try:
        network = read_description(folder / "enhancer.keras")
        window = network["config"]["layers"][0]["config"]["batch_shape"][1]
        if type(window) is not int or not 2 <= window <= MOST_VALUES:
            raise ValueError(f"windows of {window!r} samples")
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"Expected an enhancer whose input has one width. Received: {folder} ({' '.join(str(error).split())}).") from None
    return window
