"""The clone that the tests run in: its folder, code on its pages, and Python in a new process."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
SLOW = {"pandas", "tensorflow", "keras", "pyarrow", "sklearn", "scipy", "matplotlib"}
"""Libraries that take long to import."""


def blocks_of(page):
    """The blocks of Python on a page, given by its place in the clone."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def python(script, *words, **options):
    """Runs a script in a new process, in the folder of the clone if no other is given."""
    about = {"cwd": ROOT, "capture_output": True, "text": True}
    about["env"] = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, "-c", script, *words], **about | options)


def answered(module, words):
    """Runs a command in a new process; its last line is the slow libraries that it imported."""
    return python(
        f"import sys\nfrom {module} import main\n"
        f"try:\n    code = main({words!r})\nexcept SystemExit as end:\n    code = end.code\n"
        f"print({SLOW!r} & sys.modules.keys())\n"
        "sys.exit(code)"
    )
