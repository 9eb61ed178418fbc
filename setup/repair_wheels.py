"""Repair the build paths that the ROS 2 wheels carry, in the environment of the running interpreter.

The wheels' CMake files name the include folders of the machine they were made on (a manylinux image); an interface package
then fails to configure. Both are rewritten to this interpreter's own. Running it twice changes nothing.
"""

from __future__ import annotations

import sys
import sysconfig
from pathlib import Path

import numpy as np

WHEEL_PYTHON = "/opt/python/cp311-cp311"


def replacements() -> dict[str, str]:
    """Map each path baked into the wheels to this machine's, longest first."""
    return {
        f"{WHEEL_PYTHON}/lib/python3.11/site-packages/numpy/_core/include": np.get_include(),
        f"{WHEEL_PYTHON}/include/python3.11": sysconfig.get_path("include"),
    }


def repair(prefix: Path) -> int:
    """Rewrite the CMake files below ``prefix/share`` and return how many changed."""
    changed = 0
    for path in sorted((prefix / "share").rglob("*.cmake")):
        text = path.read_text(encoding="utf-8")
        mended = text
        for wrong, right in replacements().items():
            mended = mended.replace(wrong, right)
        if mended != text:
            path.write_text(mended, encoding="utf-8")
            changed += 1
    return changed


if __name__ == "__main__":
    sys.stdout.write(f"repaired {repair(Path(sys.prefix))} CMake files\n")
