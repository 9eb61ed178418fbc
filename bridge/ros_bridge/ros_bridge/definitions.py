"""Where the texts of definitions are found: files of packages, and the modules that ROS 1's genpy wrote.

A service's halves are messages of their own, ``Name_Request`` and ``Name_Response``, and so are an action's parts, ``NameGoal``,
``NameResult`` and ``NameFeedback``, where there is no file of that name.
"""

from __future__ import annotations

import ast
import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

SHARES_VARIABLE = "ROS_BRIDGE_ROS1_SHARE"
WORKSPACES_VARIABLE = "ROS_BRIDGE_ROS1_WORKSPACES"
MODULES_VARIABLE = "ROS_BRIDGE_ROS1_PATH"
DIVIDER = "---"
HALVES = ("_Request", "_Response")
PARTS = ("Goal", "Result", "Feedback")
MARKS_NO_PACKAGES = ("CATKIN_IGNORE", "rospack_nosubdirs")
PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


class Source(Protocol):
    """A place that has texts of definitions."""

    def message(self, name: str) -> str | None:
        """Return the text of a message ``package/Name``, or None when it is not here."""

    def places(self) -> str:
        """Name the place, for people."""


def ament_prefixes() -> list[Path]:
    """Return the prefixes in which this environment looks for ROS 2 packages."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", sys.prefix).split(os.pathsep) if prefix]


def ros1_shares() -> list[Path]:
    """Return where ROS 1 packages lie: the robot's workspace, told folders, ``ROS_PACKAGE_PATH``, Debian's and those of /opt/ros."""
    variables = (WORKSPACES_VARIABLE, SHARES_VARIABLE, "ROS_PACKAGE_PATH")
    told = [entry for variable in variables for entry in os.environ.get(variable, "").split(os.pathsep)]
    installed = [share for share in sorted(Path("/opt/ros").glob("*/share")) if not (share / "ament_index").exists()]  # those are ROS 2's
    return list(dict.fromkeys([*(Path(entry) for entry in told if entry), Path("/usr/share"), *installed]))


def ros1_modules() -> list[Path]:
    """Return the folders in which genpy's modules of ROS 1 lie: told by the environment, then Debian's and those of /opt/ros."""
    told = os.environ.get(MODULES_VARIABLE)
    places = [Path("/usr/lib/python3/dist-packages"), *sorted(Path("/opt/ros").glob("*/lib/python3/dist-packages"))]
    return [*([Path(told)] if told else []), *places]


def split(text: str, number: int) -> list[str]:
    """Return that many parts of a service's or action's text; one that is missing is empty, and none is divided further than that.

    As genmsg and genaction do it: a line that begins with ``---`` divides, whatever follows.
    """
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if not line.strip().startswith(DIVIDER):
            parts[-1].append(line)
        elif len(parts) < number:
            parts.append([])
    return ["\n".join(part) for part in [*parts, *[[]] * number][:number]]


class DefinitionFiles:
    """Definition texts by ``package/Name``, from ``<package>/{msg,srv,action}/<Name>.{msg,srv,action}``; the first folder that has it wins.

    A package lies in a folder itself or, as in ``ROS_PACKAGE_PATH``, anywhere below it.
    """

    def __init__(self, folders: Iterable[Path], modules: Iterable[Path] = ()) -> None:
        """Look in the folders in this order, then in the genpy modules below ``modules`` (Python paths of ROS 1)."""
        self._folders = tuple(folders)
        self._modules = tuple(modules)
        self._packages: dict[Path, dict[str, Path]] = {}

    def each(self) -> Iterator[DefinitionFiles]:
        """Yield each folder as a place of its own."""
        for folder in self._folders:
            yield DefinitionFiles([folder])
        for module in self._modules:
            yield DefinitionFiles([], [module])

    def message(self, name: str) -> str | None:
        """Return a message's text, or None when it is nowhere."""
        package, short = name.split("/")
        for folder in self._folders:
            for candidate in self._candidates(folder, package):
                if (text := _from_files(candidate, short)) is not None:
                    return text
        return next((text for folder in self._modules for text in _from_modules(folder / package, short)), None)

    def has_service(self, name: str) -> bool:
        """Return whether a service ``package/Name`` is here."""
        return self.message(name + HALVES[0]) is not None

    def places(self) -> str:
        """Name the folders, for people."""
        return ", ".join(map(str, [*self._folders, *(self._modules if not self._folders else ())])) or "an empty search path"

    def _candidates(self, folder: Path, package: str) -> Iterator[Path]:
        """Yield the folders that can be a package's."""
        yield folder / package
        if folder.name == "share":  # packages lie side by side in it
            return
        if folder not in self._packages:
            self._packages[folder] = dict(_packages_below(folder))
        if package in self._packages[folder]:
            yield self._packages[folder][package]


def _packages_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield the packages below a folder, as rospack finds them: no package within a package, none where a mark says so."""
    seen: set[str] = set()
    for place, below, files in os.walk(folder, followlinks=True):
        if (real := os.path.realpath(place)) in seen or any(mark in files for mark in MARKS_NO_PACKAGES):
            below.clear()
            continue
        seen.add(real)
        if "package.xml" in files:
            name = PACKAGE_NAME.search((Path(place) / "package.xml").read_text(encoding="utf-8", errors="replace"))
            yield name[1] if name else Path(place).name, Path(place)
            below.clear()
        below[:] = sorted(entry for entry in below if not entry.startswith("."))


def _from_files(package: Path, short: str) -> str | None:
    """Return a message's text from the files of a package, also one that is a part of a service or an action."""
    if (text := _read(package / "msg" / f"{short}.msg")) is not None:
        return text
    for kind, endings in (("srv", HALVES), ("action", PARTS)):
        for place, ending in enumerate(endings):
            if short.endswith(ending) and (whole := _read(package / kind / f"{short.removesuffix(ending)}.{kind}")) is not None:
                return split(whole, len(endings))[place]
    return None


def _read(path: Path) -> str | None:
    # What is no UTF-8 stands in comments.
    return path.read_text(encoding="utf-8-sig", errors="replace") if path.is_file() else None


def _from_modules(package: Path, short: str) -> Iterator[str]:
    """Read ``_full_text`` out of a generated module without importing it; its first part is the definition as it was written."""
    kind, module, class_name = "msg", short, short
    for ending in HALVES:
        if short.endswith(ending):
            kind, module, class_name = "srv", short.removesuffix(ending), short.removesuffix(ending) + ending.lstrip("_")
    source = _read(package / kind / f"_{module}.py")
    for node in ast.parse(source).body if source is not None else ():
        if not isinstance(node, ast.ClassDef) or node.name != class_name:
            continue
        for statement in node.body:
            match statement:
                case ast.Assign(targets=[ast.Name(id="_full_text")], value=ast.Constant(value=str() as text)):
                    yield text.split("=" * 80)[0]
