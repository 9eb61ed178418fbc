"""A mission along a route, ready to be run: what its tree needs to be made."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from alula.common.files import write_json
from alula.common.scenarios import Scenario
from alula.missions.director import Mission
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import MissionPlan
from alula.missions.skillset import Client, Clock
from uav_missions import remarks
from uav_missions.blackboard import RouteBlackboard
from uav_missions.flying import FlightSettings
from uav_missions.route import Route

ROBOT = ("navigation", "perception", "mapping", "video")
"""All skillsets of the drone."""
DEPARTURE = ("flight_status", "ON_GROUND")
"""Lift-off."""

MakeTree = Callable[[Mapping[str, Client], RouteBlackboard, Any], Mission]
"""Makes a mission of the clients by skillset, its memory, and its settings."""


def plan_of(scenario: Scenario, route: Route) -> MissionPlan:
    """Return the plan of a scenario along a route: what its ``mission`` names makes it."""
    module, _, function = scenario.mission.partition(":")
    make_plan: Callable[[Route], MissionPlan] = getattr(importlib.import_module(module), function)
    return make_plan(route)


def route_plan(name: str, skillsets: tuple[str, ...], make_tree: MakeTree, settings: FlightSettings, route: Route) -> MissionPlan:
    """Return a mission along a route; its parameters are the fields of its settings."""

    def make(clients: Mapping[str, Client], clock_ns: Clock, values: Mapping[str, float]) -> tuple[Mission, RouteBlackboard]:
        blackboard = RouteBlackboard(clock_ns=clock_ns, route=route, pending=PendingInterrupts(clock_ns))
        return make_tree(clients, blackboard, settings_of(settings, values)), blackboard

    waypoints = [list(waypoint) for waypoint in route.waypoints]
    facts = lambda: {"waypoints": len(waypoints), "waypoints_reached": route.reached, "route": waypoints}  # noqa: E731
    return MissionPlan(name, skillsets, make, vars(settings), DEPARTURE, facts, remarks.listen)


def settings_of(defaults: FlightSettings, values: Mapping[str, float]) -> FlightSettings:
    """Return settings from parameters; what counts is a whole number."""
    kinds = {name: type(value) for name, value in vars(defaults).items()}
    return type(defaults)(**{name: kinds[name](value) for name, value in values.items()})


def write_route(out: Path, route: Route) -> None:
    """Write ``route.json``: the waypoints that the mission means to fly (map, ENU, metres)."""
    write_json(out / "route.json", {"frame": "map", "route": [list(waypoint) for waypoint in route.waypoints]})
