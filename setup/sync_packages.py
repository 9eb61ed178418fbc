"""Make this interpreter's environment hold exactly the pinned packages of a file: install and uninstall the differences only.

usage: python sync_packages.py REQUIREMENTS [--runtime] [--beside REQUIREMENTS]

``--beside`` names a file whose packages stay as they are, there or not.
``--runtime`` leaves out the pins below the line ``# Only to build and to test``.
A package counts as installed when its version is the pinned one and none of its files is missing. What no pin
names is removed, but for pip and setuptools. An environment that sees another one by a path file has what is pinned there, too.
"""

from __future__ import annotations

import argparse
import csv
import re
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from importlib.metadata import Distribution, distributions
from pathlib import Path

KEPT = {"pip", "setuptools"}
TOOLS = "# Only to build and to test"
MARKER = re.compile(r'(?:python_version *(<|>=) *"(\d+)\.(\d+)")?')


def normalized(name: str) -> str:
    """Return a package's name as registries compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def applies(marker: str, python: tuple[int, int]) -> bool:
    """Return whether a pin is for this version of Python: ``python_version < "3.12"``, ``python_version >= "3.12"`` or nothing."""
    match = MARKER.fullmatch(marker)
    if match is None:
        raise SystemExit(f"error: the condition '{marker}' of a pin is not known; write python_version < \"3.12\", or >=")
    return match[1] is None or (python < (int(match[2]), int(match[3]))) == (match[1] == "<")


def read_pins(path: Path, python: tuple[int, int] = sys.version_info[:2], *, runtime: bool = False) -> dict[str, str]:
    """Read the lines ``name==version`` and ``name==version ; python_version < "3.12"``; comments start with ``#``."""
    text = path.read_text(encoding="utf-8")
    lines = (line.partition("#")[0].strip() for line in (text.partition(TOOLS)[0] if runtime else text).splitlines())
    pins = (line.partition(";") for line in lines if line)
    pairs = (pin.partition("==") for pin, _, marker in pins if applies(marker.strip(), python))
    return {normalized(name): version.strip() for name, _, version in pairs}


def whole(distribution: Distribution) -> bool:
    """Return whether all files that pip recorded are still there; compiled ones are made again when they are needed."""
    # Not by `files`: since Python 3.12 that leaves out what is missing.
    recorded = (row[0] for row in csv.reader((distribution.read_text("RECORD") or "").splitlines()))
    return all(Path(str(distribution.locate_file(file))).exists() for file in recorded if not file.endswith(".pyc"))


def installed() -> dict[str, Distribution]:
    """Map names to what Python finds first, in this environment and in those below it."""
    found: dict[str, Distribution] = {}
    for distribution in distributions():
        found.setdefault(normalized(distribution.metadata["Name"]), distribution)
    return found


def removable(pins: Mapping[str, str], site: Path) -> list[str]:
    """Return the names of what pip has installed into a folder and no pin names; a wheel may also carry metadata of other names."""
    own = (d for d in distributions(path=[str(site)]) if (d.read_text("INSTALLER") or "").strip() == "pip")
    return sorted({normalized(d.metadata["Name"]) for d in own} - set(pins) - KEPT)


def pip(*words: str) -> None:
    """Run pip; exit with its code when it fails."""
    done = subprocess.run([sys.executable, "-m", "pip", "--no-input", "--disable-pip-version-check", *words], check=False)
    if done.returncode:
        sys.exit(done.returncode)


def sync(requirements: Path, *, runtime: bool, beside: Path | None) -> None:
    """Remove what is not pinned, then install what is missing, damaged or of another version."""
    pins = read_pins(requirements, runtime=runtime)
    stays = read_pins(beside, runtime=runtime) if beside else {}
    extra = removable({**stays, **pins}, Path(sysconfig.get_path("purelib")))
    if extra:
        pip("uninstall", "--yes", *extra)
    present = installed()
    wanted = [name for name, version in pins.items() if name not in present or present[name].version != version or not whole(present[name])]
    if wanted:
        damaged = ["--force-reinstall"] if any(name in present and present[name].version == pins[name] for name in wanted) else []
        pip("install", "--progress-bar", "off", "--no-deps", *damaged, *(f"{name}=={pins[name]}" for name in wanted))
    sys.stdout.write(f"{len(extra)} packages removed, {len(wanted)} installed, {len(pins) - len(wanted)} were there\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("requirements", type=Path)
    parser.add_argument("--runtime", action="store_true")
    parser.add_argument("--beside", type=Path)
    options = parser.parse_args()
    sync(options.requirements, runtime=options.runtime, beside=options.beside)
