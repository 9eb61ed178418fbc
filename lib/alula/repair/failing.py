"""The leaves of a mission that fail by a fault, and need a response."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from alula.prove.mission.system import System
from alula.repair.naming import listed, sentence, told_failure, told_state
from alula.repair.purposes import broken_by
from alula.repair.subject import Subject, texts_of
from alula.trees.node import Node

_DEGRADED = re.compile(r"\bdegraded\s*:=")


@dataclass(frozen=True)
class Failing:
    """A leaf that needs a response, and the states with which its skill can't run (``skillset.resource``, state).

    ``results`` are those by which the fault ends it, and the conditions by which it has it refused or ended. ``shown`` is the fault in
    words of the models, with which a comment begins.
    """

    leaf: Node
    skill: str
    states: tuple[tuple[str, str], ...] = ()
    fault: str = ""
    results: tuple[str, ...] = ()
    shown: str = ""

    @property
    def degrades(self) -> bool:
        """Return whether the author marks the mission as degraded once it has failed: an end other than giving up may be good then."""
        return _DEGRADED.search(self.leaf.config.element.get("_onFailure")) is not None

    @property
    def situation(self) -> str:
        """Return the failure as a comment in the mission."""
        return sentence(self.reason)

    @property
    def reason(self) -> str:
        """Return the states with which its skill can't run, else how it fails."""
        return self.shown or told_failure(self.leaf.name, self.results)

    @property
    def words(self) -> str:
        """Return the failure as in the answers of a search."""
        by = f" by the fault {self.fault}" if self.fault else ""
        return f"{self.skill} ('{self.leaf.name}') fails{by}"


def failing_by(fault: str, subject: Subject, system: System) -> list[Failing]:
    """Return the leaves of the mission's main tree that a fault ends, each once for each place in the files."""
    effects = subject.faults[fault]
    states = [tuple(one.rsplit(" ", 1)) for one in sorted(effects.states)]
    found: dict[int, Failing] = {}
    texts = texts_of(subject.files.documents[0].root)
    for leaf in system.leaves:
        name = f"{leaf.skillset}.{leaf.model.name}"
        mine = tuple((at.partition(".")[2], state) for at, state in states if at.partition(".")[0] == leaf.skillset)
        broken = tuple((at, state) for at, state in mine if broken_by(leaf.model, at, state))
        model = leaf.model
        ends = dict.fromkeys(one.name for one in model.results)
        ends |= dict.fromkeys(one.name for several in (model.preconditions, model.invariants) for one in several)
        results = tuple(one for one in ends if any(fnmatchcase(f"{name} {one}", end) for end in effects.ends))
        if (broken or results) and leaf in system.trees[0].nodes:
            full = tuple((f"{leaf.skillset}.{at}", state) for at, state in broken)
            found.setdefault(id(leaf.config.element), Failing(leaf, name, full, fault, results, _shown(full, texts)))
    return list(found.values())


def _shown(states: Sequence[tuple[str, str]], texts: Sequence[str]) -> str:
    """Return the states with which a skill can't run, in the author's spelling; nothing where there are none."""
    several: dict[str, list[str]] = {}
    for at, state in states:
        several.setdefault(at, []).append(state)
    return listed((told_state(at, *ones, texts=texts) for at, ones in several.items()), "or") if several else ""
