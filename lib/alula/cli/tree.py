"""``alula tree FILE|FOLDER...``: draw a mission, and tick it without any robot.

Ends with 0, and with 2 when a file can't be read or is wrong, or the tree can't be ticked.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from alula.check.robot import models_of, part_of
from alula.cli.options.models import TICKS
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.cli.tree_page import TreePage
from alula.common.files import write_text
from alula.common.robots import RobotError, find_robot
from alula.missions.drawing import draw, drawn_as_text
from alula.missions.part import NO_PART
from alula.missions.registry import registry_of
from alula.trees.answers import Answers, AnswersError, StepClock, read_answers, scripted_tree, ticks
from alula.trees.document import read_document
from alula.trees.enums import read_enums
from alula.trees.errors import TreeError, did_you_mean
from alula.trees.format3 import DECLARED, OLD, convert
from alula.trees.library import Library
from alula.trees.reading import TreeFiles, read_files, read_models
from alula.trees.registry import NodeRegistry
from alula.trees.structure import missing_trees
from alula.trees.tree import Tree
from alula.trees.view import view_of

COMMAND = "alula tree"
WRONG = 2


def main(words: Sequence[str] | None = None) -> int:
    """Draw; return the exit code."""
    given = parse("tree", words)
    try:
        return run(given)
    except (AnswersError, TreeError, OSError) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG


def run(given: argparse.Namespace) -> int:
    """Do what is asked for; raises AnswersError, TreeError, OSError."""
    if given.ticks is not None and (given.ticks < 0 or given.answers is None):
        raise AnswersError(f"--ticks {given.ticks}: is a number of ticks, and goes with --answers FILE")
    for option in ("seed", "trace", "html"):
        if given.answers is None and getattr(given, option) not in {None, False}:
            raise AnswersError(f"--{option}: goes with --answers FILE")
    if given.to is not None or given.out is not None:
        return converted(given)
    wrong: list[TreeError] = []
    found = list(mains(given.files, given.main, given.package, wrong.append))
    for option in ("svg", "answers", "html"):
        if getattr(given, option) is not None and found[1:]:
            raise TreeError(f"--{option}: is of one tree; choose it with `--main`: {', '.join(files.main for files in found)}")
    enums = {} if given.enums is None else read_enums(given.enums)
    answers = Answers({}) if given.answers is None else read_answers(given.answers, given.seed or 0)
    for files in found:
        clock = StepClock()
        tell_missing(files)
        try:
            tree = scripted_tree(files, registry(files, given.palette), answers, clock, enums)
        except TreeError as error:
            wrong.append(error)
            continue
        view, title = view_of(tree.root), f"{Path(files.path).name}: {files.main}"
        if given.answers is not None:
            tick_through(tree, answers, clock, given, title)
        if given.svg is not None:
            write_text(given.svg, draw(view, title))
        if given.answers is None:
            sys.stdout.write(json.dumps(view.as_dict()) + "\n" if given.json else drawn_as_text(view, title))
    for one in wrong:  # a file of a folder keeps no other from being drawn
        sys.stderr.write(f"{COMMAND}: {one}\n")
    return WRONG if wrong else 0


def tell_missing(files: TreeFiles) -> None:
    """Tell of trees that are used and that are in none of the files."""
    missing = missing_trees(files)
    for first, *_ in list(missing.values())[:1]:
        warner(COMMAND)(f"{first.place}: trees that are in none of the files are drawn as leaves: {', '.join(missing)}")


def tick_through(tree: Tree, answers: Answers, clock: StepClock, given: argparse.Namespace, title: str) -> None:
    """Tick it, tell of each tick, and write the page of them; that has all ticks up to an error, too. Raises TreeError, OSError."""
    told = None if given.html is None else TreePage(tree)
    try:
        for tick in ticks(tree, answers, TICKS if given.ticks is None else given.ticks, clock):
            text = tick.as_json(trace=given.trace) if given.json else tick.as_text(trace=given.trace)
            sys.stdout.write(text + "\n")
            if told is not None:
                told.add(tick, clock())
    finally:
        if told is not None:
            write_text(given.html, told.text(title))


def converted(given: argparse.Namespace) -> int:
    """Write a file of format 3 as one of format 4, and tell what a person has to decide; raises TreeError, OSError."""
    if given.to is None or len(given.files) != 1 or given.files[0].is_dir():
        raise TreeError("--to 4 FILE --out FILE converts one file; of what it includes, each file by itself")
    document = read_document(given.files[0])
    if document.root.tag != "root" or document.root.get(DECLARED, OLD) != OLD:
        raise TreeError(f"{given.files[0]}: is no file of BehaviorTree.CPP 3; there is nothing to convert")
    decisions = convert(document)
    if given.out is None:
        sys.stdout.write(document.text())
    else:
        write_text(given.out, document.text())
    for problem in decisions:
        sys.stderr.write(f"{problem}\n")
    return 0


def mains(places: Sequence[Path], main: str, packages: Mapping[str, Path], wrong: Callable[[TreeError], object]) -> Iterator[TreeFiles]:
    """Yield each main tree of the first place with the files that it needs; the other places are a library for it.

    Of a folder these are all trees that are a part of no other, of a file the one that it says, or all such where it says none; with
    ``main`` the tree of that ID. ``wrong`` takes what keeps a file from being read. Raises TreeError.
    """
    library = Library(packages)
    paths = library.files(places[0])
    if len(places) > 1 or places[0].is_dir():
        library.add(places)
    if not paths:
        raise TreeError(f"{places[0]}: there is no file of trees in this folder")
    if main and len(paths) > 1:
        having = list(dict.fromkeys(one.place for one in library.trees.get(main, ())))
        if not having:
            cure = did_you_mean(main, library.trees) or f"there are {', '.join(sorted(library.trees))}"
            raise TreeError(f"{places[0]}: no file in this folder has a tree '{main}'; {cure}")
        if having[1:]:
            raise TreeError(f"{having[0]}: '{main}' stands in {having[1]}, too; name the file that is meant")
        paths = [Path(having[0].path)]
    for path in paths:
        try:
            files = read_files(path, main=main, library=library, whole=False)
            if places[0].is_dir() and not main and (files.is_part or not files.trees):
                continue
            tops = [files.main] if files.main else files.tops
            found = [read_files(path, main=top, library=library) for top in tops or [""]]
        except TreeError as error:
            wrong(error)
            continue
        yield from found


def registry(files: TreeFiles, more: Sequence[Path]) -> NodeRegistry:
    """Return the types of node that there are: a mission's of the robot around, of the file, of palettes; raises TreeError."""
    types = [one for place in more for one in read_models(place)]
    try:
        robot = find_robot()
    except RobotError:
        return registry_of(files, (), NO_PART, more=types)  # a tree of others needs none
    return registry_of(files, models_of(robot, warner(COMMAND)), part_of(robot, warner(COMMAND)), more=types)


if __name__ == "__main__":
    sys.exit(main())
