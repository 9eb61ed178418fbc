"""Have an environment find Python packages where their sources are: python link_packages.py alula|robot 1|2.

This is what an editable installation of each would do, in one path file: no process needs a path that is set by hand, and nothing is
written beside the sources. A robot's environment goes on in Alula's, whose own path files count there, too.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from workspace import ROOT, STATE, Workspace, alulas_workspace, find_packages, robots_workspace

FILE = "alula_workspace.pth"
LIBRARY_TOOLS_AND_TESTS = ("lib", "flight", "tests/support", "tools")
"""Folders of the checkout that hold Python packages of neither workspace."""
VERSION = f"python{sys.version_info.major}.{sys.version_info.minor}"


def site_packages(state: Path, world: str) -> Path:
    """Return the folder of an environment that holds its Python packages."""
    return state / f"venv{world}" / "lib" / VERSION / "site-packages"


def built(workspace: Workspace, world: str) -> Path:
    """Return the folder that the generated message packages are in."""
    inside = "devel/lib/python3/dist-packages" if world == "1" else f"install/lib/{VERSION}/site-packages"
    return workspace.folder / inside


def sources(workspace: Workspace) -> list[Path]:
    """Return the folders of packages that are plain Python."""
    return [package.folder for package in workspace.packages.values() if (package.folder / "setup.cfg").exists()]


def python_below() -> list[Path]:
    """Return where the Python packages of underlays are."""
    return [Path(place) for place in os.environ.get("ALULA_UNDERLAY_PYTHON", "").split(os.pathsep) if place]


def alulas_lines(world: str) -> list[str]:
    """Return the lines of Alula's path file in the order in which they are looked into."""
    workspace = alulas_workspace(world)
    places = [built(workspace, world), *(ROOT / place for place in LIBRARY_TOOLS_AND_TESTS), *sources(workspace), *python_below()]
    return [str(place.resolve()) for place in places]


def robots_lines(world: str) -> list[str]:
    """Return the lines of a robot's path file."""
    workspace, generated = robots_workspace(world), Path(os.environ["ALULA_ROBOT_STATE"]) / "generated"
    # Managers run over rospy, too.
    managers = [package.folder for name, package in find_packages([generated]).items() if world == "1" and name.endswith("_managers")]
    places = [built(workspace, world), *sources(workspace), *managers, *python_below()]
    return [*(str(place.resolve()) for place in places), f"import site; site.addsitedir({str(site_packages(STATE, world))!r})"]


LINES = {"alula": alulas_lines, "robot": robots_lines}
STATES = {"alula": "ALULA_STATE", "robot": "ALULA_ROBOT_STATE"}


if __name__ == "__main__":
    whose, world = sys.argv[1:]
    text = "".join(f"{line}\n" for line in LINES[whose](world))
    (site_packages(Path(os.environ[STATES[whose]]), world) / FILE).write_text(text, encoding="utf-8")
