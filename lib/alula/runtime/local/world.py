"""A world in one process: skillsets, their clients, and one virtual clock for all."""

from __future__ import annotations

import functools
from collections.abc import Callable, Coroutine, Iterable, Mapping
from typing import TypeVar

from alula.common.public import public
from alula.model.model import Skillset
from alula.runtime.client import Client
from alula.runtime.core.events import EngineEvent
from alula.runtime.hooks import SkillHooks
from alula.runtime.local.clock import NANOSECONDS, VirtualClock, WorldError
from alula.runtime.local.managers import HooksFactory, LocalManagers
from alula.runtime.local.middleware import Bus, VirtualMiddleware
from alula.runtime.local.values import Types
from alula.runtime.middleware import EVENTS

T = TypeVar("T")
OnEvent = Callable[[str, EngineEvent], None]


class LocalClient(Client):
    """The client of a skillset in the same process."""

    def __init__(self, bus: Bus, name: str) -> None:
        super().__init__(VirtualMiddleware(bus, name), name)


@public()
class LocalWorld:
    """Managers and clients of skillsets in one process and in virtual time; the same calls make the same run.

    Args:
        skillsets: served from the beginning.
        make_hooks: makes the hooks of each of them, ``make_hooks(managers) -> {skill: hooks}``; ``managers`` has the clock
            (``after``), ``transition`` and ``publish``.
        start_s: mission clock at the beginning.
        latency_s: how long each message between clients and managers takes.
        types: what the models' types are in ROS, so that lists are not taken for points.
    """

    def __init__(
        self,
        skillsets: Iterable[Skillset] = (),
        make_hooks: HooksFactory | None = None,
        *,
        start_s: float = 0.0,
        latency_s: float = 0.0,
        types: Types | None = None,
    ) -> None:
        self.clock = VirtualClock(start_s)
        self.managers: dict[str, LocalManagers] = {}
        self._bus = Bus(self.clock, lambda condition, timeout_s: self.run_until(condition, timeout_s=timeout_s), types or {}, latency_s)
        self._running = False
        for skillset in skillsets:
            if make_hooks is None:
                raise WorldError(f"skillset {skillset.name} has no hooks: give make_hooks")
            self.serve(skillset, make_hooks)

    @property
    def bus(self) -> Bus:
        """The bus that carries messages between clients and managers."""
        return self._bus

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self.clock.now_s

    @property
    def errors(self) -> list[str]:
        """The errors that belong to no execution, a line each."""
        return [error for managers in self.managers.values() for error in managers.errors]

    # --- managers and clients ----------------------------------------------------------------------------------------

    def serve(self, skillset: Skillset, make_hooks: HooksFactory | Mapping[str, SkillHooks]) -> LocalManagers:
        """Start the managers of a skillset; clients of that name find them.

        Raises:
            WorldError: they are there already.
            SkillRuntimeError: a skill has no hooks, or hooks have no skill.
        """
        before = self.managers.get(skillset.name)
        if before is not None and before.alive:
            raise WorldError(f"the managers of {skillset.name} run already; kill them first")
        managers = self.managers[skillset.name] = LocalManagers(self._bus, skillset, make_hooks)
        return managers

    def client(self, name: str) -> LocalClient:
        """Make a client of a skillset, which may be served later."""
        return LocalClient(self._bus, name)

    def kill(self, name: str) -> None:
        """End managers at once, like ``kill -9``; their clients see them go.

        Raises:
            WorldError: they are not there.
        """
        managers = self.managers.get(name)
        if managers is None or not managers.alive:
            raise WorldError(f"there are no managers of {name} to kill; there are {', '.join(self.managers) or 'none'}")
        managers.vanish()

    def on_event(self, callback: OnEvent) -> None:
        """Call ``callback(skillset, event)`` for each event of the skillsets that are served now."""
        for name in self.managers:
            VirtualMiddleware(self._bus, name).subscribe(EVENTS, functools.partial(callback, name))

    # --- time --------------------------------------------------------------------------------------------------------

    def run_until(self, condition: Callable[[], bool], *, timeout_s: float) -> bool:
        """Let time pass, from job to job, until a condition holds; False when it does not within ``timeout_s`` of mission clock.

        Raises:
            WorldError: called from inside a job, or jobs beget jobs without end.
        """
        if self._running:
            raise WorldError("the world runs already: a job can't wait for it; use add_done_callback or on_change there")
        until_ns, do_next = self.clock.now_ns + round(timeout_s * NANOSECONDS), self.clock.do_next
        self._running = True
        try:
            while not condition():
                if not do_next(until_ns):
                    return condition()
        finally:
            self._running = False
        return True

    def run_for(self, duration_s: float) -> None:
        """Run all that is due within so much mission time."""
        self.run_until(lambda: False, timeout_s=duration_s)

    def run(self, coroutine: Coroutine[object, object, T], *, timeout_s: float = 3600.0) -> T:
        """Run a coroutine that awaits handles and answers of this world, in virtual time; return what it returns.

        Raises:
            WorldError: it does not end within ``timeout_s`` of mission clock, or this is called from inside a job.
        """
        returned: list[T] = []

        def step() -> bool:
            try:
                coroutine.send(None)
            except StopIteration as stop:
                returned.append(stop.value)
            return bool(returned)

        try:
            over = self.run_until(step, timeout_s=timeout_s)
        finally:
            coroutine.close()
        if not over:
            raise WorldError(f"the coroutine has not ended within {timeout_s:g} s")
        return returned[0]
