"""Repair the build paths that the ROS 2 wheels carry, in the environment of the running interpreter.

The wheels' CMake files name the include folders of the machine they were made on (a manylinux image); an interface package
then fails to configure. Both are rewritten to this interpreter's own. Running it twice changes nothing.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

import numpy as np

WHEEL_PYTHON = r"/opt/python/cp3\d+-cp3\d+"
REPLACEMENTS = (
    (re.compile(WHEEL_PYTHON + r"/lib/python3\.\d+/site-packages/numpy/_core/include"), np.get_include()),
    (re.compile(WHEEL_PYTHON + r"/include/python3\.\d+"), sysconfig.get_path("include")),
)


def repair(prefix: Path) -> int:
    """Rewrite the CMake files below ``prefix/share`` and return how many changed."""
    changed = 0
    for path in sorted((prefix / "share").rglob("*.cmake")):
        text = path.read_text(encoding="utf-8")
        mended = text
        for wrong, right in REPLACEMENTS:
            mended = wrong.sub(right, mended)
        if mended != text:
            path.write_text(mended, encoding="utf-8")
            changed += 1
    return changed


if __name__ == "__main__":
    sys.stdout.write(f"repaired {repair(Path(sys.prefix))} CMake files\n")
