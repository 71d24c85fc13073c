"""Description of the machine, and settings that make it compute like a processor without AVX-512."""

import os
import platform
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_INSTRUCTION_SETS = r"sse4_2|avx|avx2|fma|avx_vnni|avx512\w*|amx\w*|asimd|sve\w*"

AVX2 = {"ONEDNN_MAX_CPU_ISA": "AVX2", "ATEN_CPU_CAPABILITY": "avx2", "MKL_ENABLE_INSTRUCTIONS": "AVX2"}
"""Environment variables that restrict TensorFlow and PyTorch to AVX2, the instructions of most laptops."""
PLAIN_KERNELS = {"TF_ENABLE_ONEDNN_OPTS": "0"}
"""TensorFlow's default on a processor without AVX-512, which a user of plain Keras therefore has there."""


def machine() -> dict:
    """Returns the processor with its instruction sets, and the versions of the numerical libraries."""
    versions = {}
    for name in ("tensorflow", "keras", "tf_keras", "torch", "numpy", "pyarrow"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    text = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace") if Path("/proc/cpuinfo").is_file() else ""
    return {
        "processor": _of(text, "model name") or platform.processor() or platform.machine(),
        "instruction_sets": instruction_sets(text),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **versions,
    }


def instruction_sets(cpuinfo: str) -> list[str]:
    """Returns the vector instruction sets that the content of `/proc/cpuinfo` lists. An empty content gives none."""
    flags = (_of(cpuinfo, "flags") or _of(cpuinfo, "Features") or "").split()
    return sorted({flag for flag in flags if re.fullmatch(_INSTRUCTION_SETS, flag)})


def has_avx512(about: dict) -> bool:
    """Returns whether a processor has AVX-512, with which TensorFlow enables oneDNN by default."""
    return "avx512f" in about.get("instruction_sets", ())


def _of(cpuinfo: str, key: str) -> str | None:
    found = re.search(rf"^{key}\s*: (.*)$", cpuinfo, re.MULTILINE)
    return found and found[1].strip()
