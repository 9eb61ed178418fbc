"""How the tree of a flown mission reacted to each failure: the skills that it requested next, and what else ran at that moment.

This is what the proof states of all runs (``alula.prove.mission.responses``), of one: by ticks, not by the managers' events.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from alula.missions.skills import SkillNode
from alula.missions.treeview import path_of
from alula.records.tree import Path
from alula.runtime.handle import SkillHandle
from alula.trees.node import Node
from alula.trees.status import FAILURE, RUNNING, Status


@dataclass(frozen=True)
class FlownResponse:
    """A failure that the tree saw, and its reaction.

    Attributes:
        id: of the execution that failed.
        place: of its leaf in the tree.
        skill: ``skillset.skill``.
        state: in which the execution ended.
        result: of the end: the result, or the precondition or invariant that did not hold.
        moment: the other skills whose leaves ran before the tick that saw it.
        asked: the places of the leaves that were asked for at once, in that tick or in the next that asked for any; empty: there was none.
    """

    id: str
    place: Path
    skill: str
    state: str
    result: str
    moment: Path
    asked: tuple[Path, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the reaction as plain values for a row of the table."""
        return asdict(self)

    @classmethod
    def read(cls, row: Mapping[str, Any]) -> FlownResponse:
        """Return the reaction that a row of the table holds."""
        texts = {name: str(row[name]) for name in ("id", "skill", "state", "result")}
        asked = tuple(tuple(place) for place in row["asked"])
        return cls(**texts, place=tuple(row["place"]), moment=tuple(row["moment"]), asked=asked)


@dataclass
class _Tick:
    """What a tick saw and did; ``running`` are the leaves that ran before it, their skills asked for."""

    running: Sequence[SkillNode]
    failed: list[tuple[SkillNode, SkillHandle]] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


class Ticks:
    """Listens to a mission's ticks (a ``Listener`` of ``MockedMission``), and returns the reactions at its end."""

    def __init__(self) -> None:
        self._ticks = [_Tick(())]
        self._running: dict[SkillNode, None] = {}

    def watch(self, root: Node) -> None:
        """Record what the nodes of a tree do from now on."""
        root.watchers.append(self._changed)

    def tick(self) -> None:
        """Begin the next tick; ticks that saw no failure and requested nothing are dropped."""
        if not (self._ticks[-1].failed or self._ticks[-1].asked):
            self._ticks.pop()
        self._ticks.append(_Tick([node for node in self._running if node.leaf.handle is not None]))

    def decision(self, kind: str, skillset: str, skill: str, execution_id: str, inputs: Mapping[str, object]) -> None:  # noqa: ARG002
        """Record a request of the tree."""
        if kind == "start":
            self._ticks[-1].asked.append(execution_id)

    def report(self, skillset: str, handle: SkillHandle) -> None:
        """Ignore a report of a skill: the tree sees only the status of its leaf."""

    def sample(self, skillset: str, data: str, value: object, stamp_ns: int | None) -> None:
        """Ignore a sample of data."""

    def responses(self, places: Mapping[str, Path]) -> list[FlownResponse]:
        """Return the reactions in the order of time; ``places`` maps the IDs of executions to the leaves that requested them."""
        found: list[FlownResponse] = []
        asked: tuple[Path, ...] = ()
        for tick in reversed(self._ticks):
            asked = tuple(sorted({places[one] for one in tick.asked if one in places})) or asked
            for node, handle in reversed(tick.failed):
                moment = {one.leaf.skill_name for one in tick.running if one is not node}
                place, state = path_of(node), handle.state.value
                found.append(FlownResponse(handle.id, place, node.leaf.skill_name, state, handle.result, tuple(sorted(moment)), asked))
        return found[::-1]

    def _changed(self, node: Node, _previous: Status, status: Status) -> None:
        if not isinstance(node, SkillNode):
            return
        if status is RUNNING:
            self._running[node] = None
        else:
            self._running.pop(node, None)
        handle = node.leaf.handle
        if status is FAILURE and handle is not None and handle.done:
            self._ticks[-1].failed.append((node, handle))
