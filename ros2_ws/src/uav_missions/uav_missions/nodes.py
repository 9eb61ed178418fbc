"""Nodes of the drone's own in files of missions: the waypoints of a route, and the heading across a leg."""

from __future__ import annotations

import math

from alula import parts
from alula.trees import (
    ANY,
    DOUBLE,
    FAILURE,
    INT,
    SUCCESS,
    Answer,
    Condition,
    PortType,
    SyncAction,
    TickError,
    input_port,
    output_port,
    register,
)
from uav_missions.route import Route, route_of, wrap_rad


def _heights(value: object) -> list[float]:
    """Read heights with `;` between them, as BehaviorTree.CPP writes lists of numbers; raises ValueError."""
    words = value if isinstance(value, list) else str(value).split(";") if value else []
    try:
        heights = [float(word) for word in words]
    except ValueError:
        heights = [math.nan]
    if not all(math.isfinite(height) for height in heights):
        msg = f"'{value}' is no list of heights, such as 3;7"
        raise ValueError(msg)
    return heights


HEIGHTS = PortType("std::vector<double>", _heights, _heights)


@register("uav.NextWaypoint")
class NextWaypoint(SyncAction):
    """Writes the waypoint that is next on the route (paper, Figure 10), and the heading across the leg to it; fails when there is none.

    It writes the same one until it was reached, whichever branch flies there: a leg that one branch was interrupted on is finished by the
    other.
    """

    ports = (
        input_port("route", ANY, doc="a list of [x, y, z] (map, ENU, metres)", unit="m"),
        input_port("heights", HEIGHTS, "", "where the route's first height is flown again and again; none: the route as it is", unit="m"),
        input_port("reached", INT, doc="how many of them were reached"),
        output_port("count", INT, doc="how many there are"),
        output_port("waypoint", ANY, doc="{x, y, z}", unit="m"),
        output_port(
            "sideways", DOUBLE, doc="heading with the leg to the right: the LiDAR's scan plane holds the direction of travel", unit="rad"
        ),
    )

    def update(self) -> Answer:
        """Write."""
        route = self._route()
        self.put("count", len(route.waypoints))
        if route.current is None:
            self.feedback_message = "no more waypoints"
            return FAILURE
        x, y, z = route.current
        self.put("waypoint", {"x": x, "y": y, "z": z})
        self.put("sideways", wrap_rad(route.leg_heading_rad() + math.pi / 2))
        self.feedback_message = f"{route.reached + 1} of {len(route.waypoints)}: ({x:g}, {y:g}, {z:g})"
        return SUCCESS

    def _route(self) -> Route:
        waypoints, reached = self.get("route"), self.number("reached")
        if not isinstance(waypoints, list):
            raise TickError(f"{self.place()}: the route is no list")
        route = route_of({"route": waypoints})
        heights = self.get("heights")
        if isinstance(heights, list) and heights:
            route = route.at_heights(heights)
        route.reached = reached
        return route


@register("uav.PointsTo")
class PointsTo(Condition):
    """Succeeds when a heading that was taken is another one, within a tolerance; fails also when none was taken yet."""

    ports = (
        input_port("taken", DOUBLE, doc="the heading that was taken", unit="rad"),
        input_port("heading", DOUBLE, doc="the heading that is asked for", unit="rad"),
        input_port("tolerance", DOUBLE, "0.06", "how far they may be apart", unit="rad"),
    )

    def update(self) -> Answer:
        """Compare them."""
        entry = self.entry("taken")
        if entry is None or entry.value is None:
            return FAILURE
        apart_rad = abs(wrap_rad(self.real("taken") - self.real("heading")))
        return SUCCESS if apart_rad < self.real("tolerance") else FAILURE


PART = parts.MissionPart((NextWaypoint, PointsTo), check_inputs=route_of)
