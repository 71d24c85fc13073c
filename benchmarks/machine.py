"""Description of the machine."""

import os
import platform
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_INSTRUCTION_SETS = r"sse4_2|avx|avx2|fma|avx_vnni|avx512\w*|amx\w*|asimd|sve\w*"


def machine() -> dict:
    """Returns the processor with its instruction sets, and the versions of the numerical libraries."""
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text(encoding="ascii", errors="replace") if cpuinfo.is_file() else ""
    return {
        "processor": _field(text, "model name") or platform.processor() or platform.machine(),
        "instruction_sets": instruction_sets(text),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{name: _version(name) for name in ("tensorflow", "keras", "tf_keras", "torch", "numpy", "pyarrow")},
    }


def instruction_sets(cpuinfo: str) -> list[str]:
    """Returns the vector instruction sets that the content of `/proc/cpuinfo` lists. An empty content gives none."""
    flags = (_field(cpuinfo, "flags") or _field(cpuinfo, "Features") or "").split()
    return sorted({flag for flag in flags if re.fullmatch(_INSTRUCTION_SETS, flag)})


def _field(cpuinfo: str, key: str) -> str | None:
    found = re.search(rf"^{key}\s*: (.*)$", cpuinfo, re.MULTILINE)
    return found and found[1].strip()


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
