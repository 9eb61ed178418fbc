"""``alula palette FOLDER``: the skills, resources and own nodes of a robot as a TreeNodesModel, which Groot2 imports.

Of a folder of trees: what their models declare, or with ``--guess`` what they use and nobody declares. With ``--nav2`` what a release of
Nav2 declares.

Ends with 0, and with 2 when a model is wrong or can't be read.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from alula.check.robot import part_of
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.robots import FILE as ROBOT_FILE
from alula.common.robots import RobotError, RobotFolder, find_robot
from alula.language.errors import LanguageError, has_errors
from alula.language.fleet import load_models
from alula.language.models import ModelFile, check_files, models_in
from alula.missions.part import NO_PART
from alula.missions.registry import mission_registry
from alula.trees import nav2
from alula.trees.errors import FileError, TreeError
from alula.trees.groot.tree_xml import model_xml
from alula.trees.guessing import guessed_types
from alula.trees.library import Library
from alula.trees.node_type import Category, NodeType
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry

COMMAND = "alula palette"
WRONG = 2


def main(words: Sequence[str] | None = None) -> int:
    """Write the palette to the standard output; return the exit code."""
    given = parse("palette", words)
    try:
        types = list(asked_types(given.places, given.nav2, guess=given.guess))
    except LanguageError as error:
        sys.stderr.write(f"{error}\n")
        return WRONG
    except TreeError as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG
    sys.stdout.write(model_xml(types))
    return 0


def asked_types(places: Sequence[str], release: str | None, *, guess: bool) -> Iterator[NodeType]:
    """Yield what is asked for: Nav2's nodes, as a release declares them, or those of folders; raises LanguageError, TreeError."""
    if (release is None) != bool(places) or (release is not None and guess):
        raise TreeError("takes a FOLDER of a robot's models or of trees, or --nav2 RELEASE by itself")
    return tree_types(places, guess=guess) if release is None else iter(nav2.registry(release))


def tree_types(places: Sequence[str], *, guess: bool) -> Iterator[NodeType]:
    """Yield what trees of others declare, or what they use and nobody declares; of a robot's models what its missions have.

    Raises:
        LanguageError, TreeError: a model has errors, or a file can't be read.
    """
    library = Library()
    library.add(path for place in map(Path, places) for path in ([place] if place.is_file() else library.files(place)))
    if library.broken and not library.documents:
        raise FileError(library.broken[0])
    for problem in library.broken:
        warner(COMMAND)(str(problem))
    is_robot = (Path(places[0]) / ROBOT_FILE).is_file()  # which has missions beside its models
    if (is_robot or not library.documents) and not guess and len(places) == 1:
        yield from robot_types(places[0])
        return
    if not library.documents:
        raise TreeError(f"{places[0]}: there are no trees in it")
    declared = [one for one in library.models.values() if one.category is not Category.SUBTREE]
    if not guess:
        yield from declared
        return
    trees = list(library.elements())
    known = NodeRegistry({one.name: one for one in (*declared, *nav2.registry_for(trees), *mission_registry((), NO_PART))}.values())
    found = [one for one in guessed_types(trees, known) if one.name not in library.trees]
    warner(COMMAND)(f"nodes that are guessed from their uses: {len(found)}; look at categories, directions and types first")
    yield from found


def robot_types(folder: str) -> Iterator[NodeType]:
    """Yield the types of node that missions over a folder of models, or a fleet's, have, but for BehaviorTree.CPP's.

    Raises:
        LanguageError: a model has errors.
    """
    robot = _robot(folder)
    part = NO_PART if robot is None else part_of(robot, warner(COMMAND))
    if robot is not None and robot.robots:
        files, skillsets = [], list(load_models(robot).skillsets)
    else:
        files = check_files(models_in(folder))
        skillsets = [skillset for file in files for skillset in file.skillsets]
    for file in files:
        if has_errors(file.findings):
            raise LanguageError(file.findings)
    told = {
        f"{skillset.name}.{skill.name}": told_above(file, skill.span.line)
        for file in files
        for skillset in file.skillsets
        for skill in skillset.skills
    }
    known = standard_registry().names()  # Groot2 has these itself
    for one in mission_registry(skillsets, part):
        if one.name not in known:
            yield replace(one, doc=told.get(one.name, one.doc))


def _robot(folder: str) -> RobotFolder | None:
    """Return the robot whose models a folder holds; None for models without a robot."""
    try:
        return find_robot(Path(folder))
    except RobotError:
        return None


def told_above(file: ModelFile, line: int) -> str:
    """Return the comment that stands above a line, its first paragraph."""
    told: list[str] = []
    while file.line(line - 1).strip().startswith("//"):
        line -= 1
        told.insert(0, file.line(line).strip()[2:].strip())
    paragraph = told[: told.index("")] if "" in told else told
    return " ".join(paragraph)


if __name__ == "__main__":
    sys.exit(main())
