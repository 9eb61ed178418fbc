"""Make this interpreter's environment hold exactly the pinned packages of a file: install and uninstall the differences only.

usage: python sync_packages.py REQUIREMENTS

A package counts as installed when its version is the pinned one and none of its files is missing. pip and setuptools stay.
"""

from __future__ import annotations

import re
import subprocess
import sys
import sysconfig
from importlib.metadata import Distribution, distributions
from pathlib import Path

KEPT = {"pip", "setuptools"}


def normalized(name: str) -> str:
    """Return a package's name as registries compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def read_pins(path: Path) -> dict[str, str]:
    """Read ``name==version`` lines; comments start with ``#``."""
    lines = (line.partition("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines())
    pairs = (line.partition("==") for line in lines if line)
    return {normalized(name): version for name, _, version in pairs}


def whole(distribution: Distribution) -> bool:
    """Tell whether all files that were installed are still there; compiled ones are made again when they are needed."""
    return all(Path(str(distribution.locate_file(file))).exists() for file in distribution.files or () if file.suffix != ".pyc")


def installed(*, own_only: bool) -> dict[str, Distribution]:
    """Map names to what Python finds first; ``own_only``: in this environment, not in the system below it."""
    places = [sysconfig.get_path("purelib")] if own_only else None
    found: dict[str, Distribution] = {}
    for distribution in distributions(path=places) if places else distributions():
        found.setdefault(normalized(distribution.metadata["Name"]), distribution)
    return found


def pip(*words: str) -> None:
    """Run pip; exit with its code when it fails."""
    done = subprocess.run([sys.executable, "-m", "pip", "--no-input", "--disable-pip-version-check", *words], check=False)
    if done.returncode:
        sys.exit(done.returncode)


def sync(requirements: Path) -> None:
    """Remove what is not pinned, then install what is missing, damaged or of another version."""
    pins = read_pins(requirements)
    extra = sorted(set(installed(own_only=True)) - set(pins) - KEPT)
    if extra:
        pip("uninstall", "--yes", *extra)
    present = installed(own_only=False)
    wanted = [name for name, version in pins.items() if name not in present or present[name].version != version or not whole(present[name])]
    if wanted:
        damaged = ["--force-reinstall"] if any(name in present and present[name].version == pins[name] for name in wanted) else []
        pip("install", "--progress-bar", "off", "--no-deps", *damaged, *(f"{name}=={pins[name]}" for name in wanted))
    sys.stdout.write(f"{len(extra)} packages removed, {len(wanted)} installed, {len(pins) - len(wanted)} were there\n")


if __name__ == "__main__":
    sync(Path(sys.argv[1]))
