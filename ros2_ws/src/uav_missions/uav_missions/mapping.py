"""The mission of the paper's section 6.3: map an area by LiDAR, watched by the depth camera, or by the LiDAR when that breaks.

The tree (paper, Figures 6, 7 and 10), top to bottom as it is flown::

    mapping mission ?
      map the area ->
        take off
        fly and map ||           lidar_mapping runs on through the reconfiguration: the map must not lose its thread
          map (lidar_mapping)
          navigate ?
            ZED navigation ||
              watch with the ZED (zed_depthmap)
              until the route is flown: waypoint writer -> ZED sees -> fly straight (goto_straight) -> reached
            LiDAR navigation ->
              the vehicle obeys
              || watch with the LiDAR (lidar_depthmap)
                 LiDAR is on -> until the route is flown: waypoint writer -> turn sideways (rotate_head, when needed) ->
                   lock the heading (lock_head) || LiDAR sees -> crab (goto) -> reached
        land
      give up: hover, land where it is

What was decided, and why:

- **A sensor that failed is not trusted again** in this flight: the selector remembers its branch.
- **BLOCKED** on a leg: one more attempt after 2 s (something may have crossed the way), then the branch fails. The LiDAR may
  see a way that the ZED did not; when it is blocked, too, the mission is given up.
- **The map's LiDAR fails** while the ZED is fine: without it there is no map, which is what the flight is for. Flying on would
  only take a risk for nothing: the mission is given up. The same when the map is lost (its skill's invariant `not_lost`).
- **Giving up**: stop, hover, land where it is. The way home may be what the sensors no longer see.
- **The pilot takes over**, or the link is lost (SDK_authority is lost): the mission is given up and commands nothing, until the vehicle is
  down. When the authority comes back before (the pilot chooses GUIDED, the link holds again) and stays for 3 s, the vehicle is
  landed where it is: the route is not resumed.
- **No motion before the eye is open**: a depth map skill's progress is 1 once obstacle messages arrive; legs wait for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.decorators import SuccessIsFailure

from alula.missions.conditions import Condition, condition
from alula.missions.leaves import Check, Do, SkillLeaf
from alula.missions.plan import Inputs, MissionPlan
from alula.missions.skillset import Client
from uav_missions.blackboard import RouteBlackboard
from uav_missions.flying import FlightSettings, Flying, beside, conditions_of_flight, is_on, sees
from uav_missions.plan import route_plan


@dataclass(frozen=True, kw_only=True)
class Settings(FlightSettings):
    """Parameters of the mapping mission: those of any flight."""


@dataclass(frozen=True)
class Clients:
    """The clients of the drone's skillsets that the mission uses."""

    navigation: Client
    perception: Client
    mapping: Client


class MappingMission:
    """The tree, and what its end means."""

    def __init__(self, clients: Clients, blackboard: RouteBlackboard, settings: Settings | None = None) -> None:
        self._clients = clients
        self._blackboard = blackboard
        self._flying = Flying(clients.navigation, blackboard, settings or Settings())
        self._zed = self._watch("watch with the ZED", "zed_depthmap")
        self._lidar = self._watch("watch with the LiDAR", "lidar_depthmap")
        self.land = self._flying.land("land")
        self.flight = self._map_the_area()
        note = Do("note why", RouteBlackboard.note_reason, blackboard=blackboard)
        give_up = Sequence("give up", memory=True, children=[note, self.stop_here()])
        self.giving_up = SuccessIsFailure("given up", give_up)
        self.root = Selector("mapping mission", memory=True, children=[self.flight, self.giving_up])

    @property
    def degraded(self) -> bool:
        """Tell whether the LiDAR had to watch ahead."""
        return self._lidar.handle is not None

    @property
    def stopping(self) -> bool:
        """Tell whether the vehicle is landing."""
        return Status.RUNNING in {self.land.status, self.giving_up.status}

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start, met or not."""
        return conditions(self._clients, self._blackboard)

    def stop_here(self) -> Behaviour:
        """Make a tree that stops the vehicle and lands it where it is; also what an abort from outside ends with."""
        return self._flying.stop_here()

    # --- the tree, from the root down --------------------------------------------------------------------------------

    def _map_the_area(self) -> Sequence:
        navigate = Selector("navigate", memory=True, children=[self._zed_navigation(), self._lidar_navigation()])
        mapping = SkillLeaf("map", self._clients.mapping, "lidar_mapping", {}, blackboard=self._blackboard)
        work = beside("fly and map", navigate, mapping)
        return Sequence("map the area", memory=True, children=[self._flying.take_off(), work, self.land])

    def _zed_navigation(self) -> Behaviour:
        flying = self._flying
        straight = flying.leg("fly straight", "goto_straight")
        leg = [flying.next_waypoint(), Check("ZED sees", sees(self._zed), wait=True), straight, flying.reached()]
        return beside("ZED navigation", flying.until_flown(Sequence("leg", memory=True, children=leg)), self._zed)

    def _lidar_navigation(self) -> Behaviour:
        flying = self._flying
        lock = flying.lock_sideways()
        see = [Check("heading is locked", is_on(lock), wait=True), Check("LiDAR sees", sees(self._lidar), wait=True)]
        crab = Sequence("crab", memory=True, children=[*see, flying.leg("fly sideways", "goto")])
        locked = beside("crab with the heading locked", crab, lock)
        leg = [flying.next_waypoint(), flying.turn_sideways("turn sideways"), locked, flying.reached()]
        route = flying.until_flown(Sequence("leg sideways", memory=True, children=leg))
        watched = Sequence("with the LiDAR on", memory=True, children=[Check("LiDAR is on", is_on(self._lidar), wait=True), route])
        branch = beside("LiDAR watches", watched, self._lidar)
        return Sequence("LiDAR navigation", memory=True, children=[Check("the vehicle obeys", flying.obeys), branch])

    def _watch(self, name: str, skill: str) -> SkillLeaf[RouteBlackboard]:
        return SkillLeaf(name, self._clients.perception, skill, {}, blackboard=self._blackboard)


def conditions(clients: Clients, blackboard: RouteBlackboard) -> list[Condition]:
    """Return what the mission needs to start, met or not."""
    state = clients.perception.resources.get
    zed, lidar = (state(f"{sensor}_status", "UNKNOWN") for sensor in ("zed", "lidar"))
    broken = "the LiDAR is broken, there is nothing to map with"
    return [
        *conditions_of_flight(clients.navigation, vars(clients).values(), blackboard),
        condition(
            "the state of the ZED is known",
            holds=zed != "UNKNOWN",
            otherwise="nothing is known of the ZED" + blackboard.because("perception.zed_status"),
        ),
        condition(
            "the LiDAR works",
            holds=lidar == "OK",
            otherwise=(broken if lidar == "BROKEN" else "nothing is known of the LiDAR") + blackboard.because("perception.lidar_status"),
        ),
    ]


def plan(inputs: Inputs) -> MissionPlan:
    """Return the mission along the route of its inputs."""
    names = ("navigation", "perception", "mapping")

    def make_tree(clients: Mapping[str, Client], blackboard: RouteBlackboard, settings: Settings) -> MappingMission:
        return MappingMission(Clients(*(clients[name] for name in names)), blackboard, settings)

    return route_plan("mapping", names, make_tree, Settings(), inputs)
