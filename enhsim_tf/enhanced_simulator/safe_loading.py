"""Validates a `.keras` file before Keras opens it: its members, its layers and its sizes.

Keras' safe mode rejects code. In addition, this module rejects layers of types that the package's networks do not use,
compressed members, and layers that declare more weights than the file contains. A small file can thus not allocate much memory.
"""

import io
import json
import math
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from enhsim_tf.common.size_limits import READ_ERRORS

_MEMBERS = ["config.json", "metadata.json", "model.weights.h5"]
_MOST_DESCRIPTION = 10_000_000  # maximum bytes of a network's description; that of a discriminator has about 100,000
_MOST_LAYERS = 2_000  # a discriminator has 220
_MOST_UNSAVED = 1_000_000  # maximum number of values that layers allocate without saved weights: means and variances
_LAYERS = "Dense Conv1D BatchNormalization Normalization InputLayer Concatenate Cropping1D Flatten Reshape LeakyReLU Activation ReLU"
_LAYERS += " GlobalAveragePooling1D GlobalMaxPooling1D"
_OPERATIONS = "Absolute Add Arcsinh Concatenate Diff GetItem Log Max Maximum Mean Multiply Power Reshape Sqrt Subtract TrueDivide"
_KINDS = {
    "keras": {"Sequential", "DTypePolicy"},
    "keras.layers": set(_LAYERS.split()),
    "keras.initializers": {"HeUniform", "GlorotUniform", "RandomNormal", "RandomUniform", "Zeros", "Ones"},
    "keras.src.models.functional": {"Functional"},
    "keras.src.ops.numpy": set(_OPERATIONS.split()),
    "keras.src.ops.math": {"RFFT"},
    "keras.src.ops.nn": {"Relu"},
    None: {"__keras_tensor__", "__slice__"},
}
_UNUSED = ("lora_rank", "quantization_config")  # layer settings that would add weights


def read_description(path: str | os.PathLike) -> dict[str, Any]:
    """Reads and validates the description of a network: its layers and their sizes.

    Args:
        path: A `.keras` file.

    Raises:
        ValueError: If the archive or the description was not written by this package; the message gives the reason.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return _description_of(archive, Path(path).stat().st_size)
    except READ_ERRORS as error:
        raise ValueError(" ".join(str(error).split())[:120] or type(error).__name__) from None


def check_network(path: str | os.PathLike) -> None:
    """Checks that a file contains all the weights that it declares, and only layers that the package uses.

    Args:
        path: A `.keras` file.

    Raises:
        ValueError: If it does not; the message gives the reason.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            description = _description_of(archive, Path(path).stat().st_size)
            num_saved = _num_weights(archive.read("model.weights.h5"))
        num_declared, num_unsaved = 0, 0
        for part in _parts_of(description):
            if part["class_name"] == "Normalization":
                num_unsaved += 3 * math.prod(_shape_of(part))
            elif part["class_name"] in ("Dense", "Conv1D", "BatchNormalization"):
                num_declared += _num_declared(part)
        if num_declared > num_saved or num_unsaved > _MOST_UNSAVED:
            raise ValueError(f"layers of {num_declared + num_unsaved:,} weights in a file of {num_saved:,}")
    except READ_ERRORS as error:
        raise ValueError(" ".join(str(error).split())[:120] or type(error).__name__) from None


def _description_of(archive: zipfile.ZipFile, size: int) -> dict[str, Any]:
    if archive.getinfo("config.json").file_size > _MOST_DESCRIPTION:
        raise ValueError("a description too large")
    members = archive.infolist()
    if sorted(member.filename for member in members) != _MEMBERS:
        raise ValueError(f"an archive of other files than {', '.join(_MEMBERS)}")
    if any(member.compress_type != zipfile.ZIP_STORED or member.file_size != member.compress_size for member in members):
        raise ValueError("a compressed archive, which Keras does not write")
    if sum(member.file_size for member in members) > size:
        raise ValueError("an archive with overlapping files")
    description = json.loads(archive.read("config.json"))
    description.pop("compile_config", None)  # settings of the training, which are not loaded
    num_layers = 0
    for part in _parts_of(description):
        module, kind = part.get("module"), part["class_name"]
        if not isinstance(kind, str) or kind not in _KINDS.get(module if isinstance(module, str) else None, ()):
            raise ValueError(f"an object of type {str(module)[:40]}.{str(kind)[:40]}, which this package does not use")
        if part.get("registered_name") not in (None, kind):
            raise ValueError(f"an object registered as {str(part['registered_name'])[:40]!r}")
        if part.get("compile_config") is not None:
            raise ValueError("a nested network with training settings")
        settings = part.get("config")
        if isinstance(settings, dict) and any(settings.get(name) is not None for name in _UNUSED):
            raise ValueError(f"a layer with one of the settings {', '.join(_UNUSED)}")
        num_layers += module == "keras.layers" or str(module).startswith("keras.src.ops.")
    if num_layers > _MOST_LAYERS:
        raise ValueError(f"{num_layers:,} layers")
    return description


def _parts_of(description: Any) -> Iterator[dict[str, Any]]:
    """Yields every object of a description that names a class."""
    waiting = [description]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            if "class_name" in part:
                yield part
            waiting += part.values()
        elif isinstance(part, list):
            waiting += part


def _shape_of(part: dict[str, Any]) -> list[int]:
    """Returns the input shape of a layer without the batch axis."""
    shape = [size for size in part["build_config"]["input_shape"][1:] if size is not None]
    if not shape or any(type(size) is not int or size < 1 for size in shape):
        raise ValueError("a layer without a valid input shape")
    return shape


def _num_declared(part: dict[str, Any]) -> int:
    """Returns the number of weights that a layer will allocate."""
    settings, inputs = part["config"], _shape_of(part)[-1]
    if part["class_name"] == "BatchNormalization":
        return 2 * inputs  # a lower bound; a layer has up to twice as many
    outputs = settings["units"] if part["class_name"] == "Dense" else settings["filters"]
    width = 1 if part["class_name"] == "Dense" else math.prod(settings["kernel_size"])
    if any(type(number) is not int or number < 1 for number in (outputs, width)) or settings.get("groups", 1) != 1:
        raise ValueError("a layer without a valid size")
    return inputs * width * outputs


def _num_weights(content: bytes) -> int:
    """Returns the number of values in a file of weights, all of which must be stored in the file itself."""
    import h5py

    num_values = 0

    def look_at(name: str, part: Any) -> None:
        nonlocal num_values
        if isinstance(part, h5py.Dataset):
            num_bytes = math.prod(part.shape or (0,)) * part.dtype.itemsize
            if part.external or part.is_virtual or num_bytes > part.id.get_storage_size():
                raise ValueError("weights that are not stored in the file in full")
            num_values += num_bytes // 4

    with h5py.File(io.BytesIO(content), "r") as file:
        file.visititems(look_at)
    return num_values
