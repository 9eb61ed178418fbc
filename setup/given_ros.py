"""Say what of ROS is to be installed beside a ROS that a robot's underlays hold.

usage: python given_ros.py 1|2 [LIST], in the environment that underlays.sh prints

Without a list it prints a comment of a shell about which packages are there, where a ROS to stand on is. With one (apt.txt, jazzy.txt) it
prints those lines that set-up is to install: all of them where there is no such ROS, else what is not of ROS, and what of ROS Alula asks
for and the given one lacks.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

WHOLE = {
    "1": ("rospy", "roslaunch", "rosmaster", "genpy", "message_generation", "catkin"),
    "2": ("rclpy", "rmw_fastrtps_cpp", "rosidl_default_generators", "ament_cmake"),
}
"""Packages that a workspace of drivers has not, and a ROS to stand on has: client library, middleware, generators, build tool."""
WHEELS_ARE_OF = "jazzy"
WANTED_WHEEL = f"ros-{WHEELS_ARE_OF}-"
COMPILED = re.compile(r"\.cpython-(\d)(\d+)-.*\.so")


class GivenRosError(Exception):
    """A ROS that is given and can't be used: what is wrong, and what helps."""


@dataclass(frozen=True)
class Given:
    """What the underlays of a world hold.

    Attributes:
        prefixes: where packages are, as sourcing the underlays told.
        distribution: of the ROS in them, such as ``jazzy``; empty where it does not say.
    """

    world: str
    prefixes: tuple[Path, ...]
    distribution: str = ""

    def prefix_of(self, package: str) -> Path | None:
        """Return the first prefix that holds a package."""
        return next((prefix for prefix in self.prefixes if (prefix / "share" / package / "package.xml").is_file()), None)

    @property
    def root(self) -> Path | None:
        """Where the client library is, to name this ROS by."""
        return self.prefix_of(WHOLE[self.world][0])

    @property
    def whole(self) -> bool:
        """Whether a ROS to stand on is in them."""
        return all(self.prefix_of(package) for package in WHOLE[self.world])

    @property
    def digest(self) -> str:
        """A short hash of the names of all packages."""
        names = {path.parent.name for prefix in self.prefixes for path in prefix.glob("share/*/package.xml")}
        return hashlib.sha256(" ".join(sorted(names)).encode()).hexdigest()[:16]


def package_of(world: str, line: str) -> str:
    """Return the ROS package that a line of a list is there for; empty for what is not of ROS."""
    if world == "1":
        return line.partition(" ")[2].strip()
    # Of the two wheels of a package the one with the distribution in its name is empty and needs the other.
    return line.partition("==")[0].removeprefix(WANTED_WHEEL).removeprefix("ros-").strip().replace("-", "_")


def to_install(given: Given, lines: Sequence[str]) -> list[str]:
    """Return those lines of a list that set-up is to install beside what is given; comments stay; raises GivenRosError."""
    if not given.whole:
        return list(lines)
    packages = {line: package_of(given.world, line) for line in lines if not line.startswith("#")}
    inner = set() if given.world == "1" else set(packages.values()) - {packages[line] for line in packages if line.startswith(WANTED_WHEEL)}
    # What no one asks for is there for what is given: a ROS has what its own packages need.
    lacking = {package for package in packages.values() if package and package not in inner and not given.prefix_of(package)}
    if lacking and given.world == "2" and given.distribution != WHEELS_ARE_OF:
        names = " ".join(f"ros-{given.distribution}-{package.replace('_', '-')}" for package in sorted(lacking))
        raise GivenRosError(
            f"the ROS 2 in {given.root} is '{given.distribution}' and lacks {', '.join(sorted(lacking))}, which Alula has for "
            f"{WHEELS_ARE_OF} only; install {names}"
        )
    return [line for line in lines if not packages.get(line) or packages[line] in lacking]


def pythons(folders: Iterable[Path]) -> set[tuple[int, int]]:
    """Return the versions of Python that compiled modules in some folders are for."""
    found = (COMPILED.search(path.name) for folder in folders for path in folder.glob("*/*.so"))
    return {(int(match[1]), int(match[2])) for match in found if match}


def check_python(given: Given, folders: Sequence[Path], version: tuple[int, int]) -> None:
    """Refuse a ROS that is compiled for another Python than this system's."""
    found = pythons(folders)
    if found and version not in found:
        theirs, ours = (".".join(map(str, one)) for one in (max(found), version))
        raise GivenRosError(
            f"the ROS {given.world} in {given.root} is for Python {theirs}, and this system's is {ours}: "
            "take it out of `underlays`, and Alula brings a ROS of its own"
        )


def listed(name: str) -> list[Path]:
    """Return the folders that a variable lists between colons."""
    return [Path(place) for place in os.environ.get(name, "").split(os.pathsep) if place]


def main(world: str, *lists: str) -> None:
    """Print what is to be installed, or that a ROS is given."""
    given = Given(world, tuple(dict.fromkeys(listed("ALULA_UNDERLAYS"))), os.environ.get("ROS_DISTRO", ""))
    try:
        if given.whole:
            check_python(given, listed("ALULA_UNDERLAY_PYTHON"), sys.version_info[:2])
        lines = [line for name in lists for line in to_install(given, Path(name).read_text(encoding="utf-8").splitlines())]
    except GivenRosError as error:
        sys.exit(f"error: {error}")
    if given.whole and not lists:
        lines = [f"# a whole ROS: packages {given.digest}"]
    sys.stdout.write("".join(f"{line}\n" for line in lines))


if __name__ == "__main__":
    main(*sys.argv[1:])
