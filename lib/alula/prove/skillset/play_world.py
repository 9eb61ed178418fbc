"""Where a counterexample is played: managers of one skillset, their client, and a clock that the player moves. Here: virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

from alula.model.model import Skillset
from alula.runtime.client import Client
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.hooks import SkillHooks
from alula.runtime.local import LocalWorld


class PlayManagers(Protocol):
    """What a counterexample needs of the managers besides their client."""

    @property
    def engine(self) -> SkillsetEngine:
        """The engine that has their states."""
        ...

    def update_data(self, name: str, value: object | None) -> None:
        """Set the value of a data, or None: there is no fresh one."""
        ...


class PlayWorld(Protocol):
    """Managers of one skillset, a client of theirs, and a mission clock that moves only on request."""

    @property
    def managers(self) -> PlayManagers:
        """The managers of the skillset, with the given hooks."""
        ...

    @property
    def client(self) -> Client:
        """A client of the managers, perhaps not ready yet."""
        ...

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        ...

    def pass_time(self, seconds: float) -> None:
        """Advance the mission clock by ``seconds``; return when managers and client have the new time."""
        ...

    def settle(self, condition: Callable[[], bool]) -> None:
        """Let pending messages and jobs take effect: until the condition holds, or until it can't any more."""
        ...


Hooks = Mapping[str, SkillHooks]
MakeWorld = Callable[[Skillset, Hooks], AbstractContextManager[PlayWorld]]


class VirtualWorld:
    """Managers and client in virtual time."""

    def __init__(self, skillset: Skillset, hooks: Hooks) -> None:
        self._world = LocalWorld()
        self.managers = self._world.serve(skillset, hooks)
        self.client = self._world.client(skillset.name)

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        return self._world.clock.now_ns

    def pass_time(self, seconds: float) -> None:
        """Advance the mission clock; it takes no wall clock time."""
        self._world.run_for(seconds)

    def settle(self, condition: Callable[[], bool]) -> None:  # noqa: ARG002 - nothing more happens at this moment, whatever holds
        """Do all jobs that are due now."""
        self._world.run_for(0.0)


@contextmanager
def virtual_world(skillset: Skillset, hooks: Hooks) -> Iterator[PlayWorld]:
    """Serve a skillset in virtual time."""
    yield VirtualWorld(skillset, hooks)
