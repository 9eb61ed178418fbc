"""``alula new robot DIR``: make a robot, a working repository in a folder of its own; with ``--from-trees`` of Behaviour Trees.

Ends with 0 when it was written, 2 when the folder's name can't be used, something is in it already, or no skill can be made of the
trees; then nothing was written.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.adopt.robot import NewRobot, robot_from_trees
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.cli.tree import mains
from alula.generate.scaffold.skeleton import ScaffoldError, check, files_of, write
from alula.trees.errors import TreeError

COMMAND = "alula new"
WRONG = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Make what the command line asks for; return the exit code."""
    options = parse("new", arguments)
    folder = options.folder.expanduser().absolute()
    try:
        check(folder)
        made = _from_trees(options, folder.name)
        files = files_of(folder.name) if made is None else made.files
        write(folder, files)
    except (ScaffoldError, TreeError) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG
    except OSError as error:
        sys.stderr.write(f"{COMMAND}: {folder} can't be written: {error.strerror}\n")
        return WRONG
    if options.git and subprocess.run(["git", "init", "--quiet", str(folder)], check=False).returncode:
        return WRONG
    told = [] if made is None else [f"made of the trees: {made.about}", *(f"to decide: {one}" for one in made.decisions)]
    command = "test" if made is None else f"run {made.scenarios[0]} --mock"
    told.append(f"Next: cd {options.folder} && alula {command}, and read README.md there")
    sys.stdout.write("\n".join([*files, "", *told, ""]))
    return 0


def _from_trees(options: argparse.Namespace, name: str) -> NewRobot | None:
    """Return the robot of a folder's trees, None where a usual one is asked for; raises TreeError."""
    place: Path | None = options.from_trees
    if place is None:
        if options.main or options.package:
            raise TreeError(f"--{'main' if options.main else 'package'}: goes with --from-trees FOLDER")
        return None
    place, warn = place.expanduser(), warner(COMMAND)
    wrong: list[TreeError] = []
    found = list(mains([place], options.main, options.package, wrong.append))
    if wrong and not found:
        raise wrong[0]
    made = robot_from_trees(name, found, place if place.is_dir() else place.parent, wrong.append)
    for one in wrong:  # a file of a folder keeps no other from being used
        warn(f"left out: {one}")
    return made


if __name__ == "__main__":
    sys.exit(main())
