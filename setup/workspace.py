"""What the packages of a ROS workspace are made of, what they need, and what was built of them.

There are two workspaces in each world: Alula's general packages, built once, and on top of them a robot's own.
Contents decide what is built again, not time stamps: a fresh checkout may take over the state of another.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

if TYPE_CHECKING:
    from alula.common.robots import RobotFolder

ROOT, STATE = Path(os.environ["ALULA_ROOT"]), Path(os.environ["ALULA_STATE"])
GENERAL = {
    "1": ("skillset_interfaces", "skillset_ros1", "resource_reporter", "alula_base", "node_core"),
    "2": ("skillset_interfaces", "tf2_msgs", "ros_bridge", "ros_bridge_native", "skillset_ros2", "skill_panel"),
}
"""Alula's packages that any robot uses, by world; a robot has them from the installation, also where its folders hold them."""
PLACES = {"1": ("ros1_ws/src",), "2": ("ros2_ws/src", "bridge")}
# Of a Python package only this is installed: its modules are found in the sources (setup/env.sh).
BUILD_FILES = {"CMakeLists.txt", "package.xml", "setup.py", "setup.cfg"}
BUILD_SUFFIXES = {".msg", ".srv", ".action", ".cpp", ".hpp"}
SCRIPTS = "scripts"
CACHE = "__pycache__"
IGNORED = ("COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE")


@dataclass(frozen=True)
class Package:
    """A ROS package: where it is, what it is made of, which others it needs."""

    folder: Path
    digest: str
    needs: frozenset[str]


def digest(*parts: str | bytes) -> str:
    """Return a short hash of texts in their order."""
    hashed = hashlib.sha256()
    for part in parts:
        hashed.update(part.encode() if isinstance(part, str) else part)
        hashed.update(b"\0")
    return hashed.hexdigest()[:16]


def build_files(folder: Path) -> Iterator[Path]:
    """Yield the files of a package that decide what is built, in a fixed order."""
    for path in sorted(folder.rglob("*")):
        folders = path.relative_to(folder).parts[:-1]
        decides = path.name in BUILD_FILES or path.suffix in BUILD_SUFFIXES or (SCRIPTS in folders and CACHE not in folders)
        if decides and path.is_file():
            yield path


def read_package(folder: Path) -> tuple[str, Package]:
    """Read a package's name, contents and dependencies."""
    manifest = ET.parse(folder / "package.xml").getroot()  # noqa: S314 - our own
    needs = frozenset(str(element.text).strip() for element in manifest if element.tag.endswith("depend"))
    contents = digest(*(part for path in build_files(folder) for part in (str(path.relative_to(folder)), path.read_bytes())))
    return str(manifest.findtext("name")).strip(), Package(folder, contents, needs)


def package_folders(place: Path) -> Iterator[Path]:
    """Yield the packages in a folder and the folders below it, as colcon and catkin look for them."""
    if (place / "package.xml").is_file():
        yield place
    elif place.is_dir() and not any((place / name).exists() for name in IGNORED):
        for child in sorted(place.iterdir()):
            if not child.name.startswith("."):
                yield from package_folders(child)


def find_packages(places: Iterable[Path]) -> dict[str, Package]:
    """Return the packages in these folders by name."""
    return dict(read_package(folder) for place in places for folder in package_folders(place))


def state_of(name: str, packages: Mapping[str, Package]) -> str:
    """Return a hash of a package and of everything of the workspace that it is compiled against; Python only runs with what it needs."""
    package = packages[name]
    if not (package.folder / "CMakeLists.txt").exists():
        return package.digest
    return digest(package.digest, *(state_of(needed, packages) for needed in sorted(package.needs & packages.keys())))


@dataclass(frozen=True)
class Workspace:
    """What is built on what, in one world.

    Attributes:
        folder: where: ``build``, ``devel`` or ``install``, ``built.json``.
        packages: what is built there; ``below`` what it is built on.
        prefixes: where that is found, what counts first first.
    """

    folder: Path
    packages: Mapping[str, Package]
    below: Mapping[str, Package]
    prefixes: tuple[Path, ...]

    def states(self) -> dict[str, str]:
        """Return what each package's build depends on, as hashes."""
        return {name: state_of(name, {**self.below, **self.packages}) for name in self.packages}

    def clear(self) -> None:
        """Remove what was built: of another toolchain, or with packages that are gone and would still be found."""
        for name in ("build", "devel", "install", "built.json"):
            place = self.folder / name
            shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)


def alulas_workspace(world: str) -> Workspace:
    """Return the workspace of the general packages."""
    found = find_packages(ROOT / place for place in PLACES[world])
    own = Path("/usr") if world == "1" else STATE / "venv2"
    packages = {name: found[name] for name in found if name in GENERAL[world]}
    return Workspace(STATE / f"ros{world}", packages, {}, (*prefixes_below(), own))


def prefixes_below() -> list[Path]:
    """Return where the packages of underlays are: the robot's, or the ROS that Alula's installation stands on."""
    return [Path(place) for place in os.environ.get("ALULA_UNDERLAYS", "").split(os.pathsep) if place]


def robots_workspace(world: str) -> Workspace:
    """Return the workspace of the robot: its own packages, and those that its models generate; raises RobotError."""
    from alula.common.robots import load_robot_folder

    robot, state = load_robot_folder(Path(os.environ["ALULA_ROBOT"])), Path(os.environ["ALULA_ROBOT_STATE"])
    below = alulas_workspace(world)
    generated = find_packages([state / "generated"])
    found = find_packages((robot.ros1 if world == "1" else robot.ros2).packages)
    if world == "2" and robot.robots:
        found |= messages_of(robot)
    # ROS 1 needs the interfaces of a robot's skills for its bridge; a fleet has missions alone, which run in ROS 2.
    found |= {name: one for name, one in generated.items() if world == "2" or (name.endswith("_interfaces") and not robot.robots)}
    own = {name: package for name, package in found.items() if name not in below.packages}
    prefix = below.folder / ("devel" if world == "1" else "install")
    return Workspace(state / f"ros{world}", own, below.packages, (prefix, *below.prefixes))


def messages_of(fleet: RobotFolder) -> dict[str, Package]:
    """Return the robots' own packages of the messages that their models name: a fleet's missions take data in these."""
    from alula.language.fleet import load_models

    below = find_packages(place for one in fleet.robots.values() for place in one.ros2.packages)
    wanted = [kind.interface.partition("/")[0] for kind in load_models(fleet).types.values()]
    found: dict[str, Package] = {}
    while wanted:
        name = wanted.pop()
        if name in below and name not in found:
            found[name] = below[name]
            wanted += below[name].needs
    return found


WORKSPACES = {"alula": alulas_workspace, "robot": robots_workspace}


@dataclass(frozen=True)
class Built:
    """What was built, state by package, and with which tools."""

    tools: str
    packages: Mapping[str, str]

    @classmethod
    def read(cls, path: Path) -> Built | None:
        """Read a record; None when there is none."""
        if not path.exists():
            return None
        record = json.loads(path.read_text(encoding="utf-8"))
        return cls(record.get("tools", ""), record["packages"])

    def write(self, path: Path) -> None:
        """Write the record."""
        path.write_text(json.dumps({"tools": self.tools, "packages": self.packages}, indent=1) + "\n", encoding="utf-8")

    def without(self, names: Collection[str]) -> Built:
        """Return what holds while these packages are built: of them nothing, however that ends."""
        return Built(self.tools, {name: state for name, state in self.packages.items() if name not in names})

    def gone(self, states: Mapping[str, str]) -> set[str]:
        """Return the packages that were built and are there no more."""
        return self.packages.keys() - states.keys()

    def changed(self, states: Mapping[str, str]) -> list[str]:
        """Return the packages that were not built as they are now."""
        return [name for name, state in states.items() if self.packages.get(name) != state]
