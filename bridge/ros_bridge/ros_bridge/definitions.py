"""Where definitions of messages and services are found: files of the installed packages, and the modules that ROS 1's genpy wrote."""

from __future__ import annotations

import ast
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

SHARES_VARIABLE = "ROS_BRIDGE_ROS1_SHARE"
MODULES_VARIABLE = "ROS_BRIDGE_ROS1_PATH"
DIVIDER = "---"


def ament_prefixes() -> list[Path]:
    """Return the prefixes in which this environment looks for ROS 2 packages."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", sys.prefix).split(os.pathsep) if prefix]


def ros1_shares() -> list[Path]:
    """Return the folders in which ROS 1 packages lie: told by the environment, then Debian's and those of /opt/ros."""
    told = [*os.environ.get(SHARES_VARIABLE, "").split(os.pathsep), *os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)]
    return [*(Path(entry) for entry in told if entry), Path("/usr/share"), *sorted(Path("/opt/ros").glob("*/share"))]


def ros1_modules() -> list[Path]:
    """Return the folders in which genpy's modules of ROS 1 lie: told by the environment, then Debian's and those of /opt/ros."""
    told = os.environ.get(MODULES_VARIABLE)
    places = [Path("/usr/lib/python3/dist-packages"), *sorted(Path("/opt/ros").glob("*/lib/python3/dist-packages"))]
    return [*([Path(told)] if told else []), *places]


class DefinitionFiles:
    """Definition texts by ``package/Name``, from ``<folder>/<package>/{msg,srv}/<Name>.{msg,srv}``; the first folder that has it wins."""

    def __init__(self, folders: Iterable[Path], modules: Iterable[Path] = ()) -> None:
        """Look in the folders in this order, then in the genpy modules below ``modules`` (Python paths of ROS 1)."""
        self._folders = tuple(folders)
        self._modules = tuple(modules)

    def message(self, name: str) -> str | None:
        """Return a message's text, or None when it is nowhere."""
        path = self._find(name, "msg")
        return path.read_text(encoding="utf-8") if path is not None else self._from_module(name)

    def service(self, name: str) -> tuple[str, str] | None:
        """Return the texts of a service's request and response, or None when it is nowhere."""
        path = self._find(name, "srv")
        if path is None:
            return None
        lines = path.read_text(encoding="utf-8").splitlines()
        divider = [line.strip() for line in lines].index(DIVIDER)
        return "\n".join(lines[:divider]), "\n".join(lines[divider + 1 :])

    def places(self) -> str:
        """Name the folders, for people."""
        return ", ".join(map(str, self._folders)) or "an empty search path"

    def _find(self, name: str, kind: str) -> Path | None:
        package, short = name.split("/")
        candidates = (folder / package / kind / f"{short}.{kind}" for folder in self._folders)
        return next((path for path in candidates if path.is_file()), None)

    def _from_module(self, name: str) -> str | None:
        """Read ``_full_text`` out of a generated module without importing it; its first part is the definition as it was written."""
        package, short = name.split("/")
        paths = (folder / package / "msg" / f"_{short}.py" for folder in self._modules)
        path = next((path for path in paths if path.is_file()), None)
        return None if path is None else next((text.split("=" * 80)[0] for text in _full_texts(path, short)), None)


def _full_texts(path: Path, class_name: str) -> Iterator[str]:
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.ClassDef) or node.name != class_name:
            continue
        for statement in node.body:
            match statement:
                case ast.Assign(targets=[ast.Name(id="_full_text")], value=ast.Constant(value=str() as text)):
                    yield text
