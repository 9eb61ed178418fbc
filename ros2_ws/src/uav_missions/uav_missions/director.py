"""From waiting for the vehicle to the outcome of the mission: what happens around the tree. No ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from uav_missions.blackboard import Blackboard
from uav_missions.mapping import Clients, MappingMission
from uav_missions.treeview import NodeView, TreeWatch


class Outcome(Enum):
    """How a mission can be, in ``mission.json``."""

    RUNNING = "running"
    ACCOMPLISHED = "accomplished"
    DEGRADED = "degraded"
    GIVEN_UP = "given_up"
    ABORTED = "aborted"
    NOT_STARTED = "not_started"


EXIT_CODES = {
    Outcome.ACCOMPLISHED: 0,
    Outcome.DEGRADED: 0,
    Outcome.GIVEN_UP: 1,
    Outcome.ABORTED: 1,
    Outcome.NOT_STARTED: 2,
}


@dataclass(frozen=True)
class End:
    """The outcome and why."""

    outcome: Outcome
    reason: str = ""


def unmet_conditions(clients: Clients) -> list[str]:
    """Return what keeps the mission from starting, in words."""
    navigation, perception = clients.navigation.resources, clients.perception.resources
    unmet = [f"the skillset {client.skillset} can't be called" for client in vars(clients).values() if not client.ready]
    if navigation.get("SDK_authority") != "AVAILABLE":
        unmet.append("the autopilot is not ours to command (SDK_authority)")
    if navigation.get("homepoint_status") != "VALID":
        unmet.append("the home point is not valid")
    if navigation.get("flight_status") != "ON_GROUND":
        unmet.append("the vehicle is not on the ground")
    for sensor, name in (("zed_status", "ZED"), ("lidar_status", "LiDAR")):
        if perception.get(sensor, "UNKNOWN") == "UNKNOWN":
            unmet.append(f"nothing is known of the {name}")
    if perception.get("lidar_status") == "BROKEN":
        unmet.append("the LiDAR is broken: there is nothing to map with")
    return unmet


class Director:
    """Waits for the vehicle, has the tree ticked, and knows the outcome. ``step`` is to be called at 10 Hz and after each event."""

    def __init__(self, mission: MappingMission, clients: Clients, blackboard: Blackboard, *, start_timeout_s: float = 60.0) -> None:
        self.end: End | None = None
        self.start_s: float | None = None
        self._mission = mission
        self._clients = clients
        self._blackboard = blackboard
        self._start_timeout_s = start_timeout_s
        self._wait_until_s: float | None = None
        self._watch = TreeWatch(mission.root)
        self._abort_reason = ""
        self._landing: Behaviour | None = None
        self._landing_watch: TreeWatch | None = None
        self._phase: Callable[[], None] = self._wait

    def step(self) -> None:
        """Do what is to be done now; returns at once. The mission is over when ``end`` is set."""
        if self.end is None:
            self._phase()

    def abort(self, reason: str) -> str:
        """Stop what runs and land where the vehicle is; return what happens, in words."""
        if self.end is not None:
            return "the mission is over already"
        if self.start_s is None:
            self.end = End(Outcome.ABORTED, reason)
            return "the mission does not start"
        if self._landing is not None or Status.RUNNING in {self._mission.land.status, self._mission.giving_up.status}:
            return "the vehicle is landing already"
        self._abort_reason = reason
        self._mission.root.stop(Status.INVALID)
        self._landing = self._mission.landing_here()
        self._landing_watch = TreeWatch(self._landing)
        self._phase = self._land
        return "the vehicle stops and lands where it is"

    def remember(self) -> None:
        """Take note of how each node is; for those who look at the tree later only, instead of ``view`` after each step."""
        self._watch.remember()
        if self._landing_watch is not None:
            self._landing_watch.remember()

    def view(self) -> NodeView:
        """Return the tree as it is now; after an abort with the landing beside it."""
        flight = self._watch.look()
        if self._landing_watch is None:
            return flight
        landing = self._landing_watch.look()
        return NodeView("aborted mission", "sequence", landing.status, self._abort_reason, "", (flight, landing))

    # --- phases ------------------------------------------------------------------------------------------------------

    def _wait(self) -> None:
        unmet, now_s = unmet_conditions(self._clients), self._blackboard.now_s
        if self._wait_until_s is None and now_s > 0.0:  # zero: the mission clock was not heard yet
            self._wait_until_s = now_s + self._start_timeout_s
        if not unmet:
            self.start_s = now_s
            self._phase = self._fly
        elif self._wait_until_s is not None and now_s > self._wait_until_s:
            self.end = End(Outcome.NOT_STARTED, "; ".join(unmet))

    def _fly(self) -> None:
        self._mission.root.tick_once()
        if self._mission.root.status is not Status.RUNNING:
            self._phase = self._settle

    def _land(self) -> None:
        if self._landing is not None:
            self._landing.tick_once()
            if self._landing.status is not Status.RUNNING:
                self._phase = self._settle

    def _settle(self) -> None:
        """Wait until what was interrupted has ended; the registry bounds this."""
        if not self._blackboard.pending.names():
            self.end = self._judge()

    def _judge(self) -> End:
        if self._landing is not None:
            return End(Outcome.ABORTED, self._abort_reason)
        if self._mission.root.status is not Status.SUCCESS:
            return End(Outcome.GIVEN_UP, self._blackboard.reason)
        if self._mission.degraded:
            return End(Outcome.DEGRADED, "; then ".join(failure.sentence() for failure in self._blackboard.failures))
        return End(Outcome.ACCOMPLISHED)
