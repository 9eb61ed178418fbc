"""``./alula new robot NAME``: put a working skeleton of a robot into the checkout.

Ends with 0 when it was written, 2 when the name can't be used or something of that name is there already; then nothing was
written.
"""

from __future__ import annotations

import argparse
import keyword
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

TEMPLATES = Path(__file__).parent / "robot"
NAME = re.compile(r"[a-z][a-z0-9_]*[a-z0-9]")


class ScaffoldError(Exception):
    """The skeleton can't be made; the message says why, and what to do."""


def camel(name: str) -> str:
    """Return ``small_rover`` as ``SmallRover``."""
    return "".join(part.capitalize() for part in name.split("_"))


def files_of(name: str, templates: Path = TEMPLATES) -> dict[str, str]:
    """Return the skeleton's files: text by path relative to the checkout. ``@name@`` and ``@Name@`` in names and texts are filled in."""
    files = {}
    for template in sorted(templates.rglob("*.in")):
        path = template.relative_to(templates).as_posix().removesuffix(".in")
        files[_filled(path, name)] = _filled(template.read_text(encoding="utf-8"), name)
    return files


def check(name: str, root: Path, files: Mapping[str, str]) -> None:
    """See that the skeleton can be written.

    Raises:
        ScaffoldError: the name is no name of a ROS package, or something is in the way.
    """
    if not NAME.fullmatch(name) or "__" in name or keyword.iskeyword(name):
        raise ScaffoldError(f"'{name}' can't name ROS packages; use lower-case letters, digits and single underscores, as small_rover")
    model = f"skillset {name} "
    for other in sorted((root / "skillsets").glob("*/*.*")):
        if other.suffix in {".skill", ".rl"} and model in other.read_text(encoding="utf-8"):
            raise ScaffoldError(f"{other.relative_to(root)} has a skillset {name} already; skillsets of all robots need different names")
    for place in sorted({"/".join(path.split("/")[: 2 if path.startswith("skillsets/") else 3]) for path in files}):
        if (root / place).exists():
            raise ScaffoldError(f"{place} is there already; choose another name, or remove it first")


def tidy(root: Path, paths: Sequence[str]) -> None:
    """Sort imports and fold lines: both depend on the name."""
    for command in (["check", "--quiet", "--select", "I", "--fix"], ["format", "--quiet"]):
        subprocess.run([sys.executable, "-m", "ruff", *command, *paths], cwd=root, check=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula new", description="Make a working skeleton to begin with.")
    parser.add_argument("what", choices=["robot"], help="what to make")
    parser.add_argument("name", metavar="NAME", help="of the robot: lower-case letters, digits, underscores")
    parser.add_argument("--root", type=Path, required=True, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    files = files_of(options.name)
    try:
        check(options.name, options.root, files)
    except ScaffoldError as error:
        sys.stderr.write(f"alula new: {error}\n")
        return 2
    try:
        for path, text in files.items():
            target = options.root / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        tidy(options.root, [path for path in files if path.endswith(".py")])
    except OSError as error:
        sys.stderr.write(f"alula new: {error.filename}: can't be written: {error.strerror}\n")
        return 2
    sys.stdout.write("".join(f"{path}\n" for path in files))
    sys.stdout.write(f"\nNext: ./alula test ros2_ws/src/{options.name}_robot, and read ros2_ws/src/{options.name}_robot/README.md\n")
    return 0


def _filled(text: str, name: str) -> str:
    return text.replace("@name@", name).replace("@Name@", camel(name))


if __name__ == "__main__":
    sys.exit(main())
