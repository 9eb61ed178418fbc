"""The skeleton of a robot: the files of a working repository, from templates."""

from __future__ import annotations

import importlib.util
import keyword
import re
import subprocess
import sys
import tempfile
from pathlib import Path

TEMPLATES = Path(__file__).parent / "robot"
NAME = re.compile(r"[a-z][a-z0-9_]*[a-z0-9]")


class ScaffoldError(Exception):
    """The skeleton can't be made; the message says why, and what to do."""


def camel(name: str) -> str:
    """Return a name of words joined by ``_`` in camel case: ``small_rover`` as ``SmallRover``."""
    return "".join(part.capitalize() for part in name.split("_"))


def files_of(name: str, templates: Path = TEMPLATES) -> dict[str, str]:
    """Return the skeleton's files: text by path relative to its folder. ``@name@`` and ``@Name@`` in names and texts are filled in."""
    files = {}
    for template in sorted(templates.rglob("*.in")):
        path = template.relative_to(templates).as_posix().removesuffix(".in")
        files[_filled(path, name)] = _filled(template.read_text(encoding="utf-8"), name)
    return files


def check(folder: Path) -> None:
    """See that the skeleton can be written.

    Raises:
        ScaffoldError: the folder's name is no name of a ROS package, or something is in the way.
    """
    name = folder.name
    if not NAME.fullmatch(name) or "__" in name or keyword.iskeyword(name):
        raise ScaffoldError(f"'{name}' can't name ROS packages; use lower-case letters, digits and single underscores, as small_rover")
    if folder.exists() and (not folder.is_dir() or any(path.name != ".git" for path in folder.iterdir())):
        raise ScaffoldError(f"{folder} is there already; choose another folder, or remove it first")


def write(folder: Path, files: dict[str, str]) -> None:
    """Write the files, first beside the folder, so that it has all or none; sort imports and fold lines, for both depend on the name.

    Raises:
        OSError: the folder can't be written.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as aside:
        made = Path(aside) / folder.name
        for path, text in files.items():
            target = made / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
            if text.startswith("#!"):
                target.chmod(0o755)
        if importlib.util.find_spec("ruff") is not None:  # an installation that builds nothing goes without
            for command in (["check", "--select", "I", "--fix"], ["format"]):
                subprocess.run([sys.executable, "-m", "ruff", *command, "--quiet", "--no-cache", "."], cwd=made, check=True)
        folder.mkdir(exist_ok=True)
        for entry in sorted(made.iterdir()):
            entry.rename(folder / entry.name)


def _filled(text: str, name: str) -> str:
    return text.replace("@name@", name).replace("@Name@", camel(name)).replace("@dot@", ".")
