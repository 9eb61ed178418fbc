"""The values of the transition system: situations of a mission with its skillsets, and what leads from one to the next."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from alula.prove.mission.oracle import Asked


class Kind(Enum):
    """The kind of an event; the value is its name in JSON."""

    TICK = "tick"
    """The tree is ticked."""
    START = "start"
    """A request arrives and the execution runs."""
    REFUSE = "refuse"
    """A request arrives and is refused: ``state`` NOT_READY (``result``: the precondition) or NOT_VALIDATED."""
    RESULT = "result"
    """An execution ends with ``result``."""
    INTERRUPT = "interrupt"
    """An interruption that the tree has asked for is done."""
    BREAK = "break"
    """Data or time break the invariant ``result`` of an execution."""
    FAIL = "fail"
    """An execution fails: its hook raises, or it makes no progress."""
    EXTERN = "extern"
    """The functional layer takes the resource ``name`` from ``source`` to ``result``."""
    EVENT = "event"
    """An event of the model."""
    DIE = "die"
    """The process of a skillset's managers ends: what it ran has FAILED, and nothing can be asked of it."""
    RESTART = "restart"
    """It is there again, as after power-up."""
    ABORT = "abort"
    """Someone aborts the mission."""
    PAUSE = "pause"
    """Someone pauses the mission and has it go on, which an execution refuses: it is interrupted."""


class Execution(NamedTuple):
    """An execution that the tree has requested and still depends on.

    ``leaf`` is the number of its leaf (``System.leaves``), ``phase`` "sent", "running" or "ended", ``asked``: its interruption was asked
    for; ``state`` and ``result`` say how it ended, as a client's handle has them. ``left``: the tree hangs on it no more, but it is to end
    before others start; with its end it is gone.
    """

    leaf: int
    phase: str
    asked: bool = False
    state: str = ""
    result: str = ""
    left: bool = False


class Managers(NamedTuple):
    """The managers of one skillset.

    ``states`` are those of its resources in the model's order, None where the managers have died; in ``executions`` those that run come
    first, in the order of their start.
    """

    states: tuple[str, ...] | None
    executions: tuple[Execution, ...] = ()


class State(NamedTuple):
    """A situation, by the numbers that ``System`` gives to memories and managers."""

    memory: int
    managers: tuple[int, ...]


class Ending(NamedTuple):
    """An execution has ended in a step."""

    leaf: int
    skill: str
    state: str
    result: str


class Event(NamedTuple):
    """One step from a situation to the next.

    Attributes:
        kind: what it is.
        skillset: of the rest; empty for what happens to the mission.
        name: a skill, resource or event of the model.
        result: a result, precondition, invariant, or the state that a resource is taken to.
        state: of a refused request.
        source: the state that a resource was in.
        leaf: that of the execution.
        failure: something fails: a result that is a failure, a refusal that no resource explains, a transition that can break an invariant.
        ended: the executions that end in the step, by ``result`` or because an invariant of theirs broke.
        changes: of resources: (resource, source, target).
        started: in a tick: the leaves whose skills the tree asks for.
        interrupted: in a tick: those that it asks to end.
        choices: in a tick: what was chosen freely, such as that a time is over.
        touched: in a tick: each node (its number in ``System.nodes``) with the answer that it gave.
    """

    kind: Kind
    skillset: str = ""
    name: str = ""
    result: str = ""
    state: str = ""
    source: str = ""
    leaf: int = -1
    failure: bool = False
    ended: tuple[Ending, ...] = ()
    changes: tuple[tuple[str, str, str], ...] = ()
    started: tuple[int, ...] = ()
    interrupted: tuple[int, ...] = ()
    choices: tuple[Asked, ...] = ()
    touched: frozenset[tuple[int, str]] = frozenset()

    @property
    def skill(self) -> str:
        """``skillset.name``."""
        return f"{self.skillset}.{self.name}"
