"""What the nodes of the drone's trees share: the route, and what leaves tell one another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from alula.missions.blackboard import Blackboard
from uav_missions.reasons import AUTHORITY_INVARIANT, holder_of_the_vehicle
from uav_missions.route import Route, Waypoint


@dataclass(kw_only=True)
class RouteBlackboard(Blackboard):
    """The mission's memory; frames and units: map, metres, radians."""

    route: Route
    waypoint: Waypoint | None = None
    aligned_yaw_rad: float | None = None

    def values(self) -> Mapping[str, object]:
        """Return what is on it by name."""
        waypoint = None if self.waypoint is None else list(self.waypoint)
        own = {"waypoint": waypoint, "waypoints_reached": self.route.reached, "aligned_yaw_rad": self.aligned_yaw_rad}
        return {**super().values(), **own}

    def explained(self) -> str:
        """Return the reason; where the authority was lost, with its holder."""
        lost = any(failure.result == AUTHORITY_INVARIANT for failure in self.failures)
        reason = holder_of_the_vehicle(self) if lost else ""
        return f"{self.reason} ({reason})" if reason else self.reason


class WaypointWriter(Behaviour):  # type: ignore[misc]  # py_trees is seen untyped
    """Writes the next waypoint of the route onto the blackboard (paper, Figure 10): SUCCESS while there are some.

    It writes the same one until it was reached, whichever branch flies there: a leg that one branch was interrupted on is
    finished by the other.
    """

    def __init__(self, name: str, *, blackboard: RouteBlackboard) -> None:
        super().__init__(name)
        self._blackboard = blackboard

    def update(self) -> Status:
        """Write the route's current waypoint (frame map, metres) to the blackboard; FAILURE where the route is done."""
        route = self._blackboard.route
        self._blackboard.waypoint = route.current
        if self._blackboard.waypoint is None:
            self.feedback_message = "no more waypoints"
            return Status.FAILURE
        x, y, z = self._blackboard.waypoint
        self.feedback_message = f"{route.reached + 1} of {len(route.waypoints)}: ({x:g}, {y:g}, {z:g})"
        return Status.SUCCESS
