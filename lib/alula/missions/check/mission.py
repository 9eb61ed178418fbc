"""Checks a mission: its file, the palettes of foreign nodes, and the models of its robot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from alula.missions.check.rules import SkillRules
from alula.missions.check.skills import Skills, SkillTraits, palette_of
from alula.model.model import Skillset
from alula.trees import nav2
from alula.trees.check.checking import check
from alula.trees.errors import FileError, Problem
from alula.trees.palette import NodeType, Palette
from alula.trees.reading import TreeFiles, read_models, read_text
from alula.trees.standard import standard_palette


def check_mission(
    path: Path, source: str | bytes, skillsets: Iterable[Skillset], palettes: Sequence[Path] = (), nodes: Iterable[NodeType] = ()
) -> list[Problem]:
    """Return what is wrong with a mission, each thing once; ``source`` is what its file has, or will have, ``nodes`` the robot's own types.

    Raises:
        FileError: the file, one that it includes, or a palette can't be read or is no XML of trees.
    """
    found: list[Problem] = []
    files = read_text(source, str(path), found.append)
    skills = Skills(skillsets)
    rules = SkillRules(skills)
    more = [one for palette in palettes for one in read_models(palette)]
    known = palette_for(files, skills, more, nodes)
    own = (rules.units, rules.results, rules.resources, rules.names)
    found += check(files, known, SkillTraits(skills), own, foreign=bool(palettes))
    endless = [problem for problem in found if problem.code.startswith("ALU0")]
    if endless:
        raise FileError(endless[0])
    spelled_out = {problem.place for problem in found if problem.code == "ALU606"}
    return [problem for problem in found if problem.code != "ALU605" or problem.place not in spelled_out]


def palette_for(files: TreeFiles, skills: Skills, more: Iterable[NodeType] = (), nodes: Iterable[NodeType] = ()) -> Palette:
    """Return the types that a mission may have: its own models, those of palettes, the robot's skills, Nav2's and BehaviorTree.CPP's."""
    types = {one.name: one for one in (*files.declared(), *more, *palette_of(skills), *nav2.palette(), *standard_palette(), *nodes)}
    return Palette(types.values())
