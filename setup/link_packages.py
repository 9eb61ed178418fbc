"""Have a ROS world's environment find the Python packages of its workspace where their sources are: python link_packages.py 1|2.

This is what an editable installation of each would do, in one path file: no process needs a path that is set by hand.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path

from workspace import find_packages

ROOT = Path(os.environ["ALULA_ROOT"])
STATE = Path(os.environ["ALULA_STATE"])
FILE = "alula_workspace.pth"
TOOLS_AND_TESTS = ("flight", "tests/support", "tools")
"""Folders of the checkout that hold Python packages of neither workspace."""


def places(world: str) -> list[Path]:
    """Return the folders in the order in which they are looked into."""
    if world == "1":
        built = STATE / "ros1" / "devel" / "lib" / "python3" / "dist-packages"
        packages = find_packages([STATE / "generated"], "*_managers")
    else:
        built = STATE / "ros2" / "install" / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"
        packages = find_packages([ROOT / "ros2_ws/src", ROOT / "bridge", STATE / "generated"])
    sources = [package.folder for package in packages.values() if (package.folder / "setup.cfg").exists()]
    return [built, *(ROOT / place for place in TOOLS_AND_TESTS), *sources]


if __name__ == "__main__":
    text = "".join(f"{place.resolve()}\n" for place in places(sys.argv[1]))
    (Path(sysconfig.get_path("purelib")) / FILE).write_text(text, encoding="utf-8")
