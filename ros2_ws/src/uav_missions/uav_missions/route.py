"""The route of a mission: waypoints, which one is next, and the heading of each leg."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path

import yaml

from alula import parts

Waypoint = tuple[float, float, float]
SHORT_LEG_M = 0.1  # a leg shorter than this on the ground has no heading of its own


class RouteError(parts.InputError):
    """A route can't be used; the message says what is wrong with it and where."""


class Route:
    """Waypoints (map, ENU, metres) flown in order. Its progress outlives the branch of the tree that flies it."""

    def __init__(self, waypoints: Sequence[Waypoint], home: Waypoint = (0.0, 0.0, 0.0)) -> None:
        self.waypoints = tuple(waypoints)
        self._home = home
        self.reached = 0

    @property
    def done(self) -> bool:
        """Return whether every waypoint was reached."""
        return self.reached >= len(self.waypoints)

    @property
    def current(self) -> Waypoint | None:
        """The waypoint to fly to, None when there are no more."""
        return None if self.done else self.waypoints[self.reached]

    def at_heights(self, heights_m: Sequence[float]) -> Route:
        """Return another route: the part up to where this one leaves its first height, at each of these heights."""
        lap = list(itertools.takewhile(lambda waypoint: waypoint[2] == self.waypoints[0][2], self.waypoints))
        return Route([(x, y, height_m) for height_m in heights_m for x, y, _ in lap], self._home)

    def leg_heading_rad(self) -> float:
        """Return the direction on the ground of the leg to the current waypoint.

        A climb or a point on the spot has none: then it is that of the next leg that has one, else of the last one before,
        else east.
        """
        headings = [self._heading_of(leg) for leg in range(len(self.waypoints))]
        ahead = [heading for heading in headings[self.reached :] if heading is not None]
        behind = [heading for heading in headings[: self.reached] if heading is not None]
        return ahead[0] if ahead else behind[-1] if behind else 0.0

    def _heading_of(self, leg: int) -> float | None:
        start, end = self.waypoints[leg - 1] if leg else self._home, self.waypoints[leg]
        east_m, north_m = end[0] - start[0], end[1] - start[1]
        return None if math.hypot(east_m, north_m) < SHORT_LEG_M else math.atan2(north_m, east_m)


def wrap_rad(angle_rad: float) -> float:
    """Return the same angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def route_of(inputs: parts.Inputs) -> Route:
    """Return the route of a mission's inputs, a list of [x, y, z]; raises RouteError."""
    waypoints = inputs.get("route")
    if not isinstance(waypoints, list) or not waypoints:
        raise RouteError("the mission needs a `route`, a list of [x, y, z]")
    return Route([_read_waypoint(number, entry) for number, entry in enumerate(waypoints, start=1)])


def inputs_of(path: Path) -> parts.Inputs:
    """Read the inputs of a mission of the drone from a world: the key ``route`` of a YAML or JSON file, a list of [x, y, z].

    Raises:
        RouteError: the file can't be read, or has no usable route.
    """
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, json.JSONDecodeError) as error:
        raise RouteError(f"{path}: {error}") from error
    if not isinstance(content, dict):
        raise RouteError(f"{path}: has no key 'route' with a list of [x, y, z]")
    try:
        return {"route": [list(waypoint) for waypoint in route_of(content).waypoints]}
    except RouteError as error:
        raise RouteError(f"{path}: {error}") from None


def _read_waypoint(number: int, entry: object) -> Waypoint:
    if isinstance(entry, list) and len(entry) == 3 and all(isinstance(v, int | float) and math.isfinite(v) for v in entry):
        return (float(entry[0]), float(entry[1]), float(entry[2]))
    raise RouteError(f"waypoint {number} is {entry!r}, not [x, y, z] in metres")
