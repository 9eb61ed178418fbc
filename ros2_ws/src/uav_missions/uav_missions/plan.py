"""A mission along a route, ready to be run: what its tree needs to be made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from alula.missions.director import Mission
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import Inputs, MissionPlan
from alula.missions.skillset import Client, Clock
from uav_missions import reasons
from uav_missions.blackboard import RouteBlackboard
from uav_missions.flying import FlightSettings
from uav_missions.route import route_of

MakeTree = Callable[[Mapping[str, Client], RouteBlackboard, Any], Mission]
"""Makes a mission of the clients by skillset, its memory, and its settings."""


def route_plan(name: str, skillsets: tuple[str, ...], make_tree: MakeTree, settings: FlightSettings, inputs: Inputs) -> MissionPlan:
    """Return a mission along the route of its inputs; its parameters are the fields of its settings. Raises RouteError."""
    route = route_of(inputs)

    def make(clients: Mapping[str, Client], clock_ns: Clock, values: Mapping[str, float]) -> tuple[Mission, RouteBlackboard]:
        blackboard = RouteBlackboard(clock_ns=clock_ns, route=route, pending=PendingInterrupts(clock_ns))
        return make_tree(clients, blackboard, settings_of(settings, values)), blackboard

    waypoints = [list(waypoint) for waypoint in route.waypoints]
    facts = lambda: {"waypoints": len(waypoints), "waypoints_reached": route.reached}  # noqa: E731
    return MissionPlan(name, skillsets, make, vars(settings), {"route": waypoints}, facts, reasons.listen)


def settings_of(defaults: FlightSettings, values: Mapping[str, float]) -> FlightSettings:
    """Return settings from parameters; what counts is a whole number."""
    kinds = {name: type(value) for name, value in vars(defaults).items()}
    return type(defaults)(**{name: kinds[name](value) for name, value in values.items()})
