"""Checks a mission: its file, the palettes of foreign nodes, and the models of its robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from alula.check.checking import Beside, check
from alula.check.defaults import wrong_defaults
from alula.check.names import NameRules
from alula.check.outcomes import OutcomeRules
from alula.check.rules import SkillRules
from alula.check.skills import Skills
from alula.language.messages import NO_MESSAGES, Messages
from alula.missions.mission_file import READY, STOP_HERE, MissionFile
from alula.missions.registry import no_class
from alula.trees.errors import FileError, Problem
from alula.trees.library import Library

BESIDE = Beside(before=(READY,), later=(STOP_HERE,))


def check_mission(
    mission: MissionFile,
    told: Sequence[Problem] = (),
    messages: Messages = NO_MESSAGES,
    *,
    foreign: bool = False,
    of_others: bool = False,
    checked: Library | None = None,
) -> list[Problem]:
    """Return what is wrong with a mission, each thing once.

    ``told`` is what was found when it was read, ``messages`` what is known of the fields of its data. One with ``foreign`` nodes runs
    somewhere else. A tree ``of_others`` is loaded by a program that chooses the main tree, fills the blackboard, and has nodes that no
    file declares. With it all files of the library ``checked`` are checked, each by itself.

    Raises:
        FileError: the tree can't be put together.
    """
    files, known = mission.files, mission.registry
    skills = Skills(mission.skillsets, messages)
    rules = SkillRules(skills)
    own = (rules.units, rules.results, rules.resources, NameRules(skills).names, OutcomeRules(skills).asked)
    foreign = foreign or of_others
    names = {*mission.source.enums, *skills.states}
    found = [*told, *check(files, known, names, own, beside=BESIDE, foreign=foreign, of_others=of_others, checked=checked)]
    found += wrong_defaults(files, foreign=foreign)
    if of_others:
        found = _told_once([replace(one, warning=one.warning or one.code == "ALU607") for one in found])
    if not foreign and (problem := no_class(files, known)) is not None:
        found.append(replace(problem, warning=True))
    endless = [problem for problem in found if problem.code.startswith("ALU0")]
    if endless:
        raise FileError(endless[0])
    spelled_out = {problem.place for problem in found if problem.code == "ALU606"}
    return [problem for problem in found if problem.code != "ALU605" or problem.place not in spelled_out]


_ONCE = {
    "ALU607": "and so it is in {} more, which is right where the program writes it",
    "ALU611": "and so it is in {} more",
    "ALU616": "and so it is in {} more",
}
"""Warnings about trees of others of which a file tells the first only."""


def _told_once(problems: Sequence[Problem]) -> list[Problem]:
    """Return problems with but one of a kind that depends on a program which nobody knows."""
    counts = Counter((one.code, one.place.path) for one in problems if one.warning and one.code in _ONCE)
    told: list[Problem] = []
    for one in problems:
        count = counts.pop((one.code, one.place.path), 0) if one.warning and one.code in _ONCE else 1
        if count:
            told.append(replace(one, message=f"{one.message}, {_ONCE[one.code].format(count - 1)}") if count > 1 else one)
    return told
