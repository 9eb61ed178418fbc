"""What the packages of a ROS workspace are made of, what they need, and what was built of them.

Contents decide what is built again, not time stamps: a fresh checkout may take over the state of another.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

# Of a Python package only this is installed: its modules are found in the sources (setup/env.sh).
BUILD_FILES = {"CMakeLists.txt", "package.xml", "setup.py", "setup.cfg"}
BUILD_SUFFIXES = {".msg", ".srv", ".action", ".cpp", ".hpp"}
SCRIPTS = "scripts"
CACHE = "__pycache__"


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


def find_packages(places: Iterable[Path], pattern: str = "*") -> dict[str, Package]:
    """Return the packages in these folders by name."""
    manifests = (path for place in places for path in sorted(place.glob(f"{pattern}/package.xml")))
    return dict(read_package(path.parent) for path in manifests)


def state_of(name: str, packages: Mapping[str, Package]) -> str:
    """Return a hash of a package and of everything of the workspace that it is compiled against; Python only runs with what it needs."""
    package = packages[name]
    if not (package.folder / "CMakeLists.txt").exists():
        return package.digest
    return digest(package.digest, *(state_of(needed, packages) for needed in sorted(package.needs & packages.keys())))


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

    def changed(self, states: Mapping[str, str]) -> list[str]:
        """Return the packages that were not built as they are now."""
        return [name for name, state in states.items() if self.packages.get(name) != state]
