"""The drone's missions, ready to be run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from skill_missions.director import Mission
from skill_missions.files import write_json
from skill_missions.pending import PendingInterrupts
from skill_missions.plan import MissionPlan
from skill_missions.skillset import Client, Clock
from uav_missions.blackboard import RouteBlackboard
from uav_missions.mapping import Clients, MappingMission, Settings
from uav_missions.route import Route

SKILLSETS = ("navigation", "perception", "mapping")
DEPARTURE = ("flight_status", "ON_GROUND")
"""Lift-off."""


def mapping_plan(route: Route) -> MissionPlan:
    """Return the mapping mission along a route; its parameters are those of ``mapping.Settings``."""

    def make(clients: Mapping[str, Client], clock_ns: Clock, values: Mapping[str, float]) -> tuple[Mission, RouteBlackboard]:
        blackboard = RouteBlackboard(clock_ns=clock_ns, route=route, pending=PendingInterrupts(clock_ns))
        skills = Clients(clients["navigation"], clients["perception"], clients["mapping"])
        return MappingMission(skills, blackboard, settings_of(values)), blackboard

    facts = lambda: {"waypoints": len(route.waypoints), "waypoints_reached": route.reached}  # noqa: E731
    return MissionPlan("mapping", SKILLSETS, make, vars(Settings()), DEPARTURE, facts)


def settings_of(values: Mapping[str, float]) -> Settings:
    """Return settings from parameters; what counts is a whole number."""
    kinds = {name: type(value) for name, value in vars(Settings()).items()}
    return Settings(**{name: kinds[name](value) for name, value in values.items()})


def write_route(out: Path, route: Route) -> None:
    """Write ``route.json``: the waypoints that the mission means to fly (map, ENU, metres)."""
    write_json(out / "route.json", {"frame": "map", "route": [list(waypoint) for waypoint in route.waypoints]})
