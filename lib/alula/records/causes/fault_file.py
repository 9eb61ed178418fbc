"""Reads ``faults.yaml``, which lies beside a robot's models: the effects of its faults and of the ends of its processes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.robots import FAULTS, RobotError, RobotFolder, find_robot
from alula.model.execution_state import ExecutionState as S
from alula.model.model import Skill, Skillset
from alula.records.causes.alarms import ANY, Alarms, alarms_of
from alula.records.causes.effects import EffectsByFault, FaultEffects
from alula.records.errors import AnalysisError
from alula.records.models import members, robot_skillsets

EFFECTS, TRANSITIONS, FIGURES = ("faults", "processes"), "transitions", "skills"
SECTIONS = (*EFFECTS, TRANSITIONS, FIGURES)
PARTS = ("states", "later", "ends", "told")
ODDS = ("happens", "lasts", "source")
"""What an entry says besides about how often it comes: `alula.odds.reading` reads it, and the section of figures."""
BAD_ENDS = (S.FAILED.value, S.INTERRUPTED.value, S.NOT_VALIDATED.value)
"""States in which an execution ends without the name of a result or a condition."""

Members = Mapping[str, Collection[str]]
"""By ``skillset.resource`` its states; by ``skillset.skill`` how it can end."""


def effects_of_robot() -> EffectsByFault:
    """Return the effects that the robot declares, as `effects_of` has them; raises AnalysisError, too, where a model has errors."""
    return effects_of(*_robot_with_models())


def effects_of(robot: RobotFolder, skillsets: Sequence[Skillset]) -> EffectsByFault:
    """Return the effects that a robot with these skillsets declares; without ``faults.yaml`` those that follow from its models.

    Those of a fleet are what its robots declare, under the fleet's names.

    Raises:
        AnalysisError: a file can't be read or is wrong; the message names file and line.
    """
    if robot.robots:
        each = [effects_of(one.robot, one.skillsets).named(one.name) for one in members(robot, skillsets)]
        always, away = frozenset().union(*(one.alarms.always for one in each)), frozenset().union(*(one.alarms.away for one in each))
        return EffectsByFault({what: one for effects in each for what, one in effects.known.items()}, Alarms(always, away))
    file = robot.file(FAULTS)
    return EffectsByFault(alarms=alarms_of(skillsets)) if file is None else load_effects(file, skillsets)


def effects_of_models() -> EffectsByFault:
    """Return the effects that follow from the robot's models; raises AnalysisError where they have errors."""
    _, skillsets = _robot_with_models()
    return EffectsByFault(alarms=alarms_of(skillsets))


def _robot_with_models() -> tuple[RobotFolder, Sequence[Skillset]]:
    try:
        robot = find_robot()
    except RobotError as error:
        raise AnalysisError(str(error)) from None
    there = bool(robot.robots) or robot.skillsets.is_dir()
    return robot, robot_skillsets() if there else ()


def states_of_faults(skillsets: Sequence[Skillset], warn: Callable[[str], object]) -> Mapping[str, frozenset[str]]:
    """Return the states in which the robot's faults show, those that have any; none where its file is wrong: ``warn`` is told."""
    try:
        effects = effects_of(find_robot(), skillsets)
    except AnalysisError as error:
        warn(f"properties can name no fault: {error}")
        return {}
    return {name: one.states for name, one in effects.known.items() if one.states}


def alarms_of_robot() -> Alarms:
    """Return the states that are bad news; none where there is no robot, or its models or faults have errors."""
    try:
        return effects_of_robot().alarms
    except AnalysisError:
        return Alarms()


def load_effects(path: Path, skillsets: Sequence[Skillset]) -> EffectsByFault:
    """Read a file, and check it against the models of the robot.

    Raises:
        AnalysisError: the file can't be read or is wrong; the message names file and line.
    """
    document = read_yaml(path, AnalysisError)
    sections = {} if document is None else document.record("a file of faults", SECTIONS)
    states = {f"{one.name}.{resource.name}": resource.states for one in skillsets for resource in one.resources}
    ends = {f"{one.name}.{skill.name}": _ends(skill) for one in skillsets for skill in one.skills}
    known: dict[str, FaultEffects] = {}
    for section, part in sections.items():
        if section not in EFFECTS:
            continue
        for name, entry in part.entries(f"`{section}`").items():
            if name in known:
                raise entry.wrong(f"`{name}` is a fault already; a process needs another name")
            said = entry.record(f"`{name}`", (*PARTS, *ODDS))
            known[name] = FaultEffects(
                states=_read(said.get("states"), "resource", "state", states),
                later=_read(said.get("later"), "resource", "state", states),
                ends=_read(said.get("ends"), "skill", "end", ends),
                told=said["told"].text("a word") if "told" in said else FaultEffects.told,
            )
    return EffectsByFault(known, alarms_of(skillsets, (state for one in known.values() for state in one.states)))


def _ends(skill: Skill) -> tuple[str, ...]:
    return (*(result.name for result in skill.results), *(invariant.name for invariant in skill.invariants), *BAD_ENDS)


def _read(part: Located | None, kind: str, word: str, members: Members) -> frozenset[str]:
    """Return the patterns of a part: ``skillset.name`` with a word or a list of words; ``*`` stands for anything."""
    found = set()
    for pattern, entry in ({} if part is None else part.entries(f"{kind}s")).items():
        matching = [name for name in members if fnmatchcase(name, pattern)]
        if not matching:
            raise entry.wrong(f"there is no {kind} `{pattern}`; there are {choices(pattern, members)}")
        known = dict.fromkeys(text for name in matching for text in members[name])
        for element in entry.elements():
            text = element.text(f"a {word}")
            if text != ANY and text not in known:
                raise element.wrong(f"{pattern} has no {word} `{text}`; it has {choices(text, known)}")
            found.add(f"{pattern} {text}")
    return frozenset(found)
