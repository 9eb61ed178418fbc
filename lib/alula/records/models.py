"""The models that a log is about: those of the robot, or others from files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.common.robots import RobotError, RobotFolder, find_robot, fleet_name
from alula.common.suggestions import nearest
from alula.language.errors import LanguageError
from alula.language.fleet import of_robot, together
from alula.language.load import load_robot, load_skillset
from alula.language.robot import Robot
from alula.model.model import Skillset
from alula.records.errors import AnalysisError


def robot_model(folder: RobotFolder) -> Robot:
    """Return a robot's skillsets with their types and bindings; raises AnalysisError where its models have errors."""
    try:
        if folder.robots:
            return together(folder, {name: robot_model(one) for name, one in folder.robots.items()})
        return _loaded(folder.skillsets, tuple(path.stat().st_mtime_ns for path in sorted(folder.skillsets.glob("*"))))
    except (LanguageError, OSError) as error:
        raise AnalysisError(str(error)) from None


@dataclass(frozen=True)
class Member:
    """A robot of a fleet.

    Attributes:
        robot: its folder.
        skillsets: its models, under their own names.
        name: makes what begins with a name in the fleet, of a skillset or a fault, of what begins with the robot's own.
        mocks: the files by which the fleet adds to what its mocks do.
    """

    robot: RobotFolder
    skillsets: tuple[Skillset, ...]
    name: Callable[[str], str]
    mocks: tuple[Path, ...]


def members(fleet: RobotFolder, skillsets: Iterable[Skillset]) -> list[Member]:
    """Return the robots of a fleet that has these models; none of a robot."""
    several = tuple(skillsets)
    return [
        Member(robot, of_robot(name, several), functools.partial(fleet_name, name), tuple(fleet.mocks_on_top(name)))
        for name, robot in fleet.robots.items()
    ]


@functools.lru_cache(maxsize=8)
def _loaded(folder: Path, _written_ns: tuple[int, ...]) -> Robot:
    return load_robot(folder)


def robot_skillsets(names: Iterable[str] | None = None) -> list[Skillset]:
    """Return models of the robot's skillsets, all of them where none are named.

    Raises:
        AnalysisError: there is no robot, it has no such skillset, or its models have errors.
    """
    try:
        own = {skillset.name: skillset for skillset in robot_model(find_robot()).skillsets}
    except RobotError as error:
        raise AnalysisError(str(error)) from None
    return list(own.values()) if names is None else [_known(own, name) for name in names]


def models_of(names: Iterable[str], files: Sequence[Path] = ()) -> list[Skillset]:
    """Return a model for each skillset: that of a file, else the robot's.

    Raises:
        AnalysisError: a file has errors, or there is no model of a skillset.
    """
    given = {}
    for file in files:
        try:
            skillset = load_skillset(file)
        except LanguageError as error:
            raise AnalysisError(str(error)) from None
        given[skillset.name] = skillset
    return [given[name] if name in given else robot_skillsets([name])[0] for name in names]


def _known(own: Mapping[str, Skillset], name: str) -> Skillset:
    if name not in own:
        hint = nearest(name, own)
        meant = f"; {hint}" if hint.startswith("did") else ""
        raise AnalysisError(f"there is no model of skillset {name!r} in this robot; give its file with --model{meant}")
    return own[name]
