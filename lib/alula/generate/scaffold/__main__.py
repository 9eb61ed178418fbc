"""``alula new robot DIR``: make a robot, a working repository in a folder of its own.

Ends with 0 when it was written, 2 when the folder's name can't be used or something is in it already; then nothing was written.
"""

from __future__ import annotations

import argparse
import importlib.util
import keyword
import re
import subprocess
import sys
from collections.abc import Sequence
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
    """Write the files; sort imports and fold lines, for both depend on the name."""
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
        if text.startswith("#!"):
            target.chmod(0o755)
    if importlib.util.find_spec("ruff") is not None:  # an installation that builds nothing goes without
        for command in (["check", "--quiet", "--select", "I", "--fix"], ["format", "--quiet"]):
            subprocess.run([sys.executable, "-m", "ruff", *command, "."], cwd=folder, check=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula new", description="Make a robot: a working repository to start from.")
    parser.add_argument("what", choices=["robot"], help="always robot")
    parser.add_argument("folder", metavar="DIR", type=Path, help="a new folder, whose name is the robot's: a-z, 0-9, _")
    parser.add_argument("--git", action="store_true", help="run git init in it")
    options = parser.parse_args(arguments)
    folder = options.folder.expanduser().absolute()
    files = files_of(folder.name)
    try:
        check(folder)
        write(folder, files)
    except ScaffoldError as error:
        sys.stderr.write(f"alula new: {error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"alula new: {error.filename}: can't be written: {error.strerror}\n")
        return 2
    if options.git and subprocess.run(["git", "init", "--quiet", str(folder)], check=False).returncode:
        return 2
    sys.stdout.write("".join(f"{path}\n" for path in files))
    sys.stdout.write(f"\nNext: cd {options.folder} && alula test, and read README.md there\n")
    return 0


def _filled(text: str, name: str) -> str:
    return text.replace("@name@", name).replace("@Name@", camel(name)).replace("@dot@", ".")


if __name__ == "__main__":
    sys.exit(main())
