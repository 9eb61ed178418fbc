"""`tools/link_rig`: a whole mission of a robot on two computers for each case of what goes; prints a row of a Markdown table for each.

Run it as root, after `alula setup` in examples/rover: `setup/in_ros2 python -m link_rig [--case NAME]... [--keep FOLDER]`, or with
`--kills MINUTES --seed N`, which kills a process at random each minute. Exit code 1: something is wrong by the simulator's truth; 2: it
can't be run here.
"""

from __future__ import annotations

import argparse
import functools
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from alula_testing.networks import why_impossible
from link_rig.cases import CASES, run_case
from link_rig.computers import RigError
from link_rig.kills import run_kills
from link_rig.robots import ROVER
from link_rig.verdicts import HEAD, Verdict


def main(words: Sequence[str] | None = None) -> int:
    """Run the cases; return the exit code."""
    parser = argparse.ArgumentParser(prog="link_rig", description="What a robot on two computers does when something goes.")
    parser.add_argument("--case", action="append", choices=CASES, metavar="NAME", help=f"of {', '.join(CASES)}; repeatable; default: all")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep there what each case writes (default: nothing is kept)")
    parser.add_argument("--kills", type=int, metavar="MINUTES", help="no case: a process is killed at random each minute, for so long")
    parser.add_argument("--seed", type=int, default=1, help="of which ones are killed (default: 1)")
    given = parser.parse_args(words)
    runs: dict[str, Callable[[Path], Verdict]] = {name: functools.partial(run_case, CASES[name]) for name in given.case or CASES}
    if given.kills:
        runs = {"kills": functools.partial(run_kills, given.kills, given.seed)}
    if reason := _why_not(given.keep and [given.keep / name for name in runs]):
        sys.stderr.write(f"link_rig: {reason}\n")
        return 2
    wrong = False
    sys.stdout.write(HEAD)
    for name, run in runs.items():
        with tempfile.TemporaryDirectory(prefix="link_rig_") as temporary:
            folder = given.keep.resolve() / name if given.keep else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            try:
                verdict = run(folder)
            except RigError as error:
                wrong = True
                sys.stderr.write(f"link_rig: {name}: {error}\n")
                continue
        wrong |= bool(verdict.wrong)
        sys.stdout.write(verdict.row)
        sys.stdout.flush()
        for one in verdict.wrong:
            sys.stderr.write(f"link_rig: {name}: {one}\n")
    return 1 if wrong else 0


def _why_not(folders: Sequence[Path] | None) -> str:
    """Return why nothing can be run here; empty: it can."""
    for folder in folders or ():
        if folder.exists() and any(folder.iterdir()):
            return f"{folder} is not empty: what lies there would be taken for what this run writes"
    if reason := why_impossible():
        return reason
    return "" if (ROVER / ".alula/venv2").is_dir() else f"the rover is not set up: alula setup in {ROVER}"


if __name__ == "__main__":
    sys.exit(main())
