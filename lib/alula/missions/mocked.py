"""The mission over mocks in one process: the same tree and the same director as over ROS 2, in virtual time, without ROS."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from alula.common.faults import FaultRequest
from alula.missions.director import Director, End, Outcome
from alula.missions.leaves import SkillLeaf
from alula.missions.plan import MissionPlan
from alula.missions.record import MissionRecord
from alula.missions.skillset import MissionClient
from alula.missions.treeview import path_of
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.local import LocalWorld
from alula.runtime.mock import Behaviour, MockRobot, mock_world

TICK_PERIOD_S = 0.1
LATENCY_S = 0.005
LIMIT_S = 3600.0
"""Mission clock after which a mission that goes round in circles is aborted, and after which twice it is left."""


class MockedMission:
    """A mission from power-up to its end.

    Args:
        skillsets: those that the plan names.
        behaviour: of the mocks.
        plan: the mission.
        faults: what fails on the way.
        seed: of the behaviour's chance.
        out: the run's folder; None leaves nothing behind.
        tick_period_s: of the tree, besides the ticks after events; 10 Hz as over ROS 2.
        latency_s: of each message between mission and managers.
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
    ) -> None:
        self.world: LocalWorld
        self.robot: MockRobot
        self.world, self.robot = mock_world(skillsets, behaviour, seed=seed, latency_s=latency_s)
        self.events: list[EngineEvent] = []
        self.places: dict[str, tuple[str, ...]] = {}
        """Where in the tree each execution was started, by its id: the names of the nodes from the root down."""
        self.wall_s = 0.0
        for fault in faults:
            self.robot.fail(fault)
        self._tick_period_s = tick_period_s
        self._due = False
        self._abort_reasons: list[str] = []
        clock_ns = lambda: self.world.clock.now_ns  # noqa: E731
        record = self._record = None if out is None else MissionRecord(out, plan, clock_ns, plan.parameters)
        clients = {skillset.name: MissionClient(self.world.client(skillset.name), self._wake, record) for skillset in skillsets}
        mission, blackboard = plan.make(clients, clock_ns, plan.parameters)
        self._leaves = [(node, path_of(node)) for node in mission.root.iterate() if isinstance(node, SkillLeaf)]
        self.director = Director(mission, blackboard)
        self.world.on_event(self._on_event)

    def run(self) -> End:
        """Run to the end; time is that of the world, so this takes a moment."""
        begun = time.perf_counter()
        self._tick_regularly()
        over = lambda: self.director.end is not None  # noqa: E731
        if not self.world.run_until(over, timeout_s=LIMIT_S):
            self.director.abort(f"not over after {LIMIT_S:g} s")
            self.world.run_until(over, timeout_s=LIMIT_S)
        self.world.run_for(0.0)
        end = self.director.end or End(Outcome.ABORTED, "the stop did not end")
        self.wall_s = time.perf_counter() - begun
        if self._record is not None:
            self._record.finish(end, self.director, self.world.now_s)
        return end

    def abort(self, reason: str) -> None:
        """Have the robot stop at the next tick; may be called by a signal's handler."""
        self._abort_reasons.append(reason)

    @property
    def open_executions(self) -> list[str]:
        """Return what has not ended."""
        return [str(execution) for managers in self.world.managers.values() for execution in managers.engine.executions]

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource."""
        return self.world.managers[skillset].engine.resources[resource].state

    @property
    def departure_s(self) -> float | None:
        """When the robot's state of departure was left first, seconds of mission clock; None also without a record."""
        return None if self._record is None else self._record.departure_s

    @property
    def notes(self) -> list[str]:
        """Return what went wrong in the mocks themselves."""
        return [*self.world.errors, *self.robot.host.notes]

    # --- ticks -------------------------------------------------------------------------------------------------------

    def _tick_regularly(self) -> None:
        if self.director.end is None:
            self.world.clock.after(self._tick_period_s, self._tick_regularly)
            self._wake()

    def _wake(self) -> None:
        """Have the tree ticked once after all that happens at this moment."""
        if not self._due:
            self._due = True
            self.world.clock.soon(self._tick)

    def _tick(self) -> None:
        self._due = False
        if self._abort_reasons:
            self._abort_now(self._abort_reasons.pop())
        if self._record is not None:
            self._record.tick(self.director)
        try:
            self.director.step()
        except Exception as error:  # noqa: BLE001 - as over ROS 2: whatever breaks in a tree, the robot has to come to rest
            self.director.abort(f"the tree raised {type(error).__name__}: {error}")
        if self._record is not None:
            self._record.outcome_of_tick(self.director)

    def _abort_now(self, reason: str) -> None:
        if self._record is not None:
            self._record.abort(reason)
        self.director.abort(reason)

    def _on_event(self, _skillset: str, event: EngineEvent) -> None:
        self.events.append(event)
        if isinstance(event, ExecutionEvent) and event.state is ExecutionState.REQUESTED:
            self.places[event.id] = next((path for leaf, path in self._leaves if leaf.handle and leaf.handle.id == event.id), ())
        if self._record is not None:
            self._record.event(event)
        self._wake()
