"""The mission over mocks in one process: the same tree and the same director as over ROS 2, in virtual time, without ROS."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Protocol

from alula.common.faults import FaultRequest, check_fault
from alula.common.operator import ABORT, PAUSE, acts_of, is_operator, on_time
from alula.common.public import public
from alula.missions.director import Director, MissionResult, Outcome
from alula.missions.driver import TICK_PERIOD_S, Job, MissionDriver
from alula.missions.pausing import PauseRefusedError
from alula.missions.plan import MissionPlan
from alula.missions.record import MissionRecord, departure_of_robot
from alula.missions.skillset import MissionClient, Recorder
from alula.mock import Behaviour, MockRobot, mock_world
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.core.records import ExecutionRecord, executions_of
from alula.runtime.local import LocalWorld

LATENCY_S = 0.005
LIMIT_S = 3600.0
"""Mission clock after which a mission that goes round in circles is aborted, unless it has another limit."""
STOP_S = 600.0
"""Mission clock after which a mission that was aborted is left, whether it has stopped or not."""


KILLED = "killed"
"""How managers fail that are ended without a word, as ``mapping:killed``; mocks do not start them again."""


NO_WAYS: Mapping[str, Sequence[str]] = {}


def kills_managers(fault: FaultRequest, skillsets: Collection[str]) -> bool:
    """Return whether a fault ends the managers of one of these skillsets."""
    return fault.what in skillsets and fault.how == KILLED


def check_faults(
    faults: Sequence[FaultRequest], behaviour: Behaviour, skillsets: Collection[str], ways: Mapping[str, Sequence[str]] = NO_WAYS
) -> None:
    """Refuse what can't fail in a mission over mocks with these skillsets.

    ``ways``: in which each fault of the scenario can occur; mocks need not distinguish them. A fault that is not in it may have any.

    Raises:
        FaultError: an operator does no such thing, or the fault can't occur in this way.
        SkillRuntimeError: the behaviour has no such fault.
    """
    acts_of(faults)
    for fault in faults:
        if not is_operator(fault) and not kills_managers(fault, skillsets):
            name, _ = behaviour.fault(fault)
            if name == fault.what and fault.what in ways:
                check_fault(fault, ways)


class Listener(Recorder, Protocol):
    """Receives what a tree requests of its skillsets and what they report, tick by tick."""

    def tick(self) -> None:
        """Take that the tree is ticked now."""
        ...


@public()
class MockedMission:
    """A mission over mocks, from power-up to its end.

    Args:
        skillsets: those that the plan names.
        behaviour: of the mocks.
        plan: the mission.
        faults: what fails on the way.
        seed: of the behaviour's chance.
        out: the run's folder; None leaves nothing behind.
        tick_period_s: of the tree, besides the ticks after events; 10 Hz as over ROS 2.
        latency_s: of each message between mission and managers.
        groot: where viewers find the tree, as `MissionDriver` has it; it raises, too, what that does.
        limit_s: mission clock after which it is aborted, as its record would grow for ever.
        listener: gets, of a mission that leaves nothing behind, what its record would have had.
    """

    def __init__(
        self,
        skillsets: Sequence[Skillset],
        behaviour: Behaviour,
        plan: MissionPlan,
        *,
        faults: Sequence[FaultRequest] = (),
        seed: int = 0,
        out: Path | None = None,
        tick_period_s: float = TICK_PERIOD_S,
        latency_s: float = LATENCY_S,
        groot: str = "",
        limit_s: float = LIMIT_S,
        listener: Listener | None = None,
    ) -> None:
        self.world: LocalWorld
        self.robot: MockRobot
        self.world, self.robot = mock_world(skillsets, behaviour, seed=seed, latency_s=latency_s)
        self.events: list[EngineEvent] = []
        self.places: dict[str, tuple[str, ...]] = {}
        """Where in the tree each execution was started, by its id: the names of the nodes from the root down."""
        self.end: MissionResult | None = None
        """How it ended; None before."""
        self.wall_s = 0.0
        names = [one.name for one in skillsets]
        self._acts = acts_of(faults)
        self._kills = [fault for fault in faults if kills_managers(fault, names)]
        self._faults = tuple(faults)
        self._departure = departure_of_robot()
        self._departed_s: float | None = None
        for fault in faults:
            if not is_operator(fault) and fault not in self._kills:
                self.robot.fail(fault)
        self._tick_period_s = tick_period_s
        self._limit_s = limit_s
        self._facts = plan.facts
        clock_ns = lambda: self.world.clock.now_ns  # noqa: E731
        record = self._record = None if out is None else MissionRecord(out, plan, clock_ns, plan.parameters)
        client = lambda name, wake: MissionClient(self.world.client(name), wake, record or listener)  # noqa: E731

        def due(tick: Job) -> None:
            if listener is not None:
                self.world.clock.soon(listener.tick)
            self.world.clock.soon(tick)

        self._driver = MissionDriver(plan, client, clock_ns, plan.parameters, record=record, soon=due, groot=groot)
        self._leaves = self._driver.leaves
        self.world.on_event(self._on_event)

    def run(self) -> MissionResult:
        """Run to the end in virtual time; return how it ended."""
        begun = time.perf_counter()
        self._driver.tick_regularly(self.world.clock.after, self._tick_period_s)
        over = lambda: self._driver.end is not None  # noqa: E731
        if not self.world.run_until(over, timeout_s=self._limit_s):
            self._driver.abort(f"its limit of {self._limit_s:g} s is over")
            self.world.run_until(over, timeout_s=STOP_S)
        self.world.run_for(0.0)
        end = self._driver.end or MissionResult(Outcome.ABORTED, "the stop did not end")
        self.wall_s = time.perf_counter() - begun
        self._driver.finish(end)
        self.end = end
        return end

    def abort(self, reason: str) -> None:
        """Abort at the next tick, with this reason; may be called by a signal handler."""
        self._driver.ask_abort(reason)

    @property
    def outcome(self) -> Outcome:
        """How it ended; RUNNING before."""
        return Outcome.RUNNING if self.end is None else self.end.outcome

    @property
    def reason(self) -> str:
        """Why it ended so, in words; empty without a reason, and before the end."""
        return "" if self.end is None else self.end.reason

    @property
    def facts(self) -> Mapping[str, object]:
        """The values of the output ports of its tree, by name."""
        return self._facts()

    @property
    def executions(self) -> list[ExecutionRecord]:
        """All executions of skills, the oldest first."""
        return executions_of(self.events)

    @property
    def ended(self) -> list[ExecutionEvent]:
        """The last event of each execution that has ended, in the order of the ends."""
        return [event for event in self.events if isinstance(event, ExecutionEvent) and event.state.terminal]

    @property
    def director(self) -> Director:
        """The director, which ticks the tree."""
        return self._driver.director

    @property
    def open_executions(self) -> list[str]:
        """Return the executions that have not ended, as text; those of killed managers count as ended."""
        living = [managers for managers in self.world.managers.values() if managers.alive]
        return [str(execution) for managers in living for execution in managers.engine.executions]

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource."""
        return self.world.managers[skillset].engine.resources[resource].state

    @property
    def departure_s(self) -> float | None:
        """When the robot first left its state of departure, seconds of mission clock; None before, and without a record."""
        return None if self._record is None else self._record.departure_s

    @property
    def faults(self) -> dict[str, float]:
        """When each fault, or act of the operator, first took effect, seconds of mission clock; without those that had none."""
        zero_s = self._departed_s
        killed = {} if zero_s is None else {f"{one.what}:{KILLED}": zero_s + (one.begin_s or 0.0) for one in self._kills}
        return {**self.robot.faults, **killed, **on_time(self._faults, zero_s)}

    @property
    def notes(self) -> list[str]:
        """Return the errors of the mocks themselves, a line each."""
        return [*self.world.errors, *self.robot.host.notes]

    def _act(self, command: str) -> None:
        """Do what the operator does; a mission that can't be paused now goes on."""
        if self._driver.end is not None:
            return
        if command == ABORT:
            self._driver.abort("aborted by the operator")
            return
        with contextlib.suppress(PauseRefusedError):
            self._driver.set_paused(paused=command == PAUSE)

    def _on_event(self, _skillset: str, event: EngineEvent) -> None:
        self.events.append(event)
        if self._departed_s is None and isinstance(event, TransitionEvent) and self._departure == (event.resource, event.from_state):
            self._departed_s = event.stamp_s
            for act in self._acts:
                self.world.clock.after(act.since_s, partial(self._act, act.command))
            for fault in self._kills:
                self.world.clock.after(fault.begin_s or 0.0, partial(self.world.kill, fault.what))
        if isinstance(event, ExecutionEvent) and event.state is ExecutionState.REQUESTED:
            self.places[event.id] = next((path for leaf, path in self._leaves if leaf.handle and leaf.handle.id == event.id), ())
        self._driver.event(event)
