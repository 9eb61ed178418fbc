"""Values that a step is made of: the situation before and after it, and what happens in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from alula.model.conditions import NO_DATA, Data, States
from alula.model.execution_state import ExecutionState
from alula.model.unmet import Unmet


@dataclass(frozen=True)
class Running:
    """An execution that has started and not ended."""

    id: str
    skill: str


@dataclass(frozen=True)
class Situation:
    """All that the next step depends on; ``running`` is in the order of the start.

    ``now_ns`` is the mission clock, ``data`` the fresh values by name. What is remembered (see ``deadlines``): ``fallen``, the
    invariants (skill, name) whose value fell through the threshold and has not recovered; ``false_since``, when an invariant that
    may be false for a while became false for an execution; ``progressed``, when the execution of this id last made progress.
    """

    states: States
    running: tuple[Running, ...] = ()
    now_ns: int = 0
    data: Data = field(default_factory=lambda: NO_DATA)
    fallen: frozenset[tuple[str, str]] = frozenset()
    false_since: Mapping[tuple[Running, str], int] = field(default_factory=dict)
    progressed: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Change:
    """A resource went from one state to another; ``reason``: why, in the words of the one who reports it, which are not compared."""

    resource: str
    source: str
    target: str
    cause: str
    reason: str = field(default="", compare=False)

    def sentence(self) -> str:
        """Return what changed, by what and why, for a person."""
        return f"{self.resource} {self.source} -> {self.target} ({self.cause})" + (f": {self.reason}" if self.reason else "")


@dataclass(frozen=True)
class Entered:
    """An execution entered a state; ``result`` and ``unmet`` as in ``Execution``; ``effect_failed``: a violation's was not possible."""

    execution: Running
    state: ExecutionState
    result: str = ""
    message: str = ""
    effect_failed: bool = False
    unmet: tuple[Unmet, ...] = field(default=(), hash=False)


@dataclass(frozen=True)
class Step:
    """The situation after a step and what happened in it."""

    situation: Situation
    happenings: tuple[Change | Entered, ...] = ()

    def then(self, *happenings: Change | Entered, situation: Situation) -> Step:
        """Continue within the same step."""
        return Step(situation, self.happenings + happenings)
