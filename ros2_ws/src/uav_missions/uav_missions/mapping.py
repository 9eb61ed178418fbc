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
  only take a risk for nothing: the mission is given up.
- **Giving up**: stop, hover, land where it is. The way home may be what the sensors no longer see.
- **The pilot takes over** (SDK_authority is lost): the mission is given up and commands nothing more, also if the
  authority comes back.
- **No motion before the eye is open**: a depth map skill's progress is 1 once obstacle messages arrive; legs wait for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import FailureIsSuccess, SuccessIsFailure

from skill_missions.decorators import RetryAfter, Until
from skill_missions.leaves import Check, Do, SkillLeaf, Stays
from skill_missions.skillset import Client
from skill_model.execution_state import ExecutionState
from uav_missions.blackboard import RouteBlackboard, WaypointWriter
from uav_missions.route import wrap_rad

AUTHORITY_INVARIANTS = frozenset({"keep_sdk_authority", "sdk_authority"})
HEADING_TOLERANCE_RAD = 0.06


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How the mission flies: metres, m/s, rad/s, seconds of mission clock."""

    takeoff_height_m: float = 3.0
    takeoff_speed_m_s: float = 2.0
    speed_m_s: float = 1.0
    turn_rate_rad_s: float = 0.6
    blocked_wait_s: float = 2.0
    hover_s: float = 2.0
    settle_s: float = 3.0
    landing_chances: int = 10


@dataclass(frozen=True)
class Clients:
    """The drone's skillsets."""

    navigation: Client
    perception: Client
    mapping: Client


class MappingMission:
    """The tree, and what its end means."""

    def __init__(self, clients: Clients, blackboard: RouteBlackboard, settings: Settings | None = None) -> None:
        self._clients = clients
        self._blackboard = blackboard
        self._settings = settings or Settings()
        self._zed = self._skill("watch with the ZED", clients.perception, "zed_depthmap")
        self._lidar = self._skill("watch with the LiDAR", clients.perception, "lidar_depthmap")
        self.land = self._land("land")
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

    def unmet_conditions(self) -> list[str]:
        """Return what keeps the mission from starting, in words."""
        return unmet_conditions(self._clients)

    # --- the tree, from the root down --------------------------------------------------------------------------------

    def _map_the_area(self) -> Sequence:
        settings = self._settings
        climb = {"height": settings.takeoff_height_m, "speed": settings.takeoff_speed_m_s}
        take_off = self._skill("take off", self._clients.navigation, "takeoff", climb, success="AT_ALTITUDE")
        navigate = Selector("navigate", memory=True, children=[self._zed_navigation(), self._lidar_navigation()])
        mapping = self._skill("map", self._clients.mapping, "lidar_mapping")
        return Sequence("map the area", memory=True, children=[take_off, beside("fly and map", navigate, mapping), self.land])

    def _zed_navigation(self) -> Behaviour:
        straight = self._leg("fly straight", "goto_straight")
        leg = [self._writer(), Check("ZED sees", sees(self._zed), wait=True), straight, self._reached()]
        return beside("ZED navigation", self._until_flown(Sequence("leg", memory=True, children=leg)), self._zed)

    def _lidar_navigation(self) -> Behaviour:
        lock = self._skill("lock the heading", self._clients.navigation, "lock_head", self._lock_inputs)
        see = [Check("heading is locked", is_on(lock), wait=True), Check("LiDAR sees", sees(self._lidar), wait=True)]
        crab = Sequence("crab", memory=True, children=[*see, self._leg("fly sideways", "goto")])
        leg = [self._writer(), self._turn_sideways(), beside("crab with the heading locked", crab, lock), self._reached()]
        route = self._until_flown(Sequence("leg sideways", memory=True, children=leg))
        watched = Sequence("with the LiDAR on", memory=True, children=[Check("LiDAR is on", is_on(self._lidar), wait=True), route])
        branch = beside("LiDAR watches", watched, self._lidar)
        return Sequence("LiDAR navigation", memory=True, children=[Check("the vehicle obeys", self._obeys), branch])

    def stop_here(self) -> Behaviour:
        """Make a tree that stops the vehicle and lands it where it is; also what an abort from outside ends with."""
        settings, navigation = self._settings, self._clients.navigation
        hover = self._skill("hover", navigation, "hover", {"duration": settings.hover_s}, success="DONE")
        land = RetryAfter(
            "until it lands",
            self._land("land here"),
            chances=settings.landing_chances,
            wait_s=settings.blocked_wait_s,
            worth_it=self._obeys,
            blackboard=self._blackboard,
        )
        on_ground = Stays("stays on the ground", self._on_ground, settings.settle_s, blackboard=self._blackboard)
        down = Selector("come down", memory=True, children=[on_ground, land])
        stop = Sequence("stop and land", memory=True, children=[FailureIsSuccess("if it can", hover), down])
        # For a while: a navigation that was started anew does not know yet that the vehicle is ours.
        pilot = Stays("the pilot has control", lambda: not self._obeys(), settings.settle_s, blackboard=self._blackboard)
        return Selector("land where it is", memory=True, children=[pilot, stop])

    # --- parts -------------------------------------------------------------------------------------------------------

    def _skill(
        self,
        name: str,
        client: Client,
        skill: str,
        inputs: Mapping[str, object] | Callable[[RouteBlackboard], Mapping[str, object]] | None = None,
        *,
        success: str = "",
        on_success: Callable[[RouteBlackboard], None] | None = None,
    ) -> SkillLeaf[RouteBlackboard]:
        results = {success} if success else set()
        after = on_success or (lambda _blackboard: None)
        return SkillLeaf(name, client, skill, inputs or {}, blackboard=self._blackboard, success=results, on_success=after)

    def _land(self, name: str) -> SkillLeaf[RouteBlackboard]:
        return self._skill(name, self._clients.navigation, "land", success="LANDED")

    def _leg(self, name: str, skill: str) -> Behaviour:
        """Fly to the waypoint, with a second attempt when something is in the way."""
        leaf = self._skill(name, self._clients.navigation, skill, self._goto_inputs, success="ARRIVED")
        return RetryAfter(
            "twice when blocked",
            leaf,
            chances=2,
            wait_s=self._settings.blocked_wait_s,
            worth_it=lambda: leaf.handle is not None and leaf.handle.result == "BLOCKED",
            blackboard=self._blackboard,
        )

    def _turn_sideways(self) -> Behaviour:
        rotate = self._skill(
            "rotate the head", self._clients.navigation, "rotate_head", self._rotate_inputs, success="ALIGNED", on_success=self._note_yaw
        )
        return Selector("turn sideways", memory=True, children=[Check("is sideways", self._is_sideways), rotate])

    def _writer(self) -> Behaviour:
        return WaypointWriter("waypoint writer", blackboard=self._blackboard)

    def _reached(self) -> Behaviour:
        return Do("waypoint reached", lambda blackboard: blackboard.route.mark_reached(), blackboard=self._blackboard)

    def _until_flown(self, leg: Behaviour) -> Behaviour:
        return Until("until the route is flown", leg, lambda: self._blackboard.route.done)

    # --- what leaves ask and tell ------------------------------------------------------------------------------------

    def _goto_inputs(self, blackboard: RouteBlackboard) -> Mapping[str, object]:
        x, y, z = blackboard.waypoint or (math.nan, math.nan, math.nan)
        return {"target": {"x": x, "y": y, "z": z}, "speed": self._settings.speed_m_s}

    def _rotate_inputs(self, blackboard: RouteBlackboard) -> Mapping[str, object]:
        return {"heading": sideways_yaw_rad(blackboard), "rate": self._settings.turn_rate_rad_s}

    def _lock_inputs(self, blackboard: RouteBlackboard) -> Mapping[str, object]:
        return {"heading": sideways_yaw_rad(blackboard)}

    @staticmethod
    def _note_yaw(blackboard: RouteBlackboard) -> None:
        blackboard.aligned_yaw_rad = sideways_yaw_rad(blackboard)

    def _is_sideways(self) -> bool:
        yaw_rad = self._blackboard.aligned_yaw_rad
        return yaw_rad is not None and abs(wrap_rad(yaw_rad - sideways_yaw_rad(self._blackboard))) < HEADING_TOLERANCE_RAD

    def _on_ground(self) -> bool:
        return self._clients.navigation.resources.get("flight_status") == "ON_GROUND"

    def _obeys(self) -> bool:
        """Tell whether the vehicle is ours to command: it is now, and nobody has taken it since the mission began."""
        taken = any(failure.result in AUTHORITY_INVARIANTS for failure in self._blackboard.failures)
        return not taken and self._clients.navigation.resources.get("SDK_authority") == "AVAILABLE"


def unmet_conditions(clients: Clients) -> list[str]:
    """Return what keeps the mission from starting, in words."""
    navigation, perception = clients.navigation.resources, clients.perception.resources
    unmet = [f"the skillset {client.skillset} can't be called" for client in vars(clients).values() if not client.ready]
    if navigation.get("SDK_authority") != "AVAILABLE":
        unmet.append("the autopilot is not ready, or not ours to command (SDK_authority)")
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


def beside(name: str, work: Behaviour, companion: Behaviour) -> Parallel:
    """Run a companion as long as the work takes: it is started first and interrupted last, and the work fails with it."""
    return Parallel(name, policy=ParallelPolicy.SuccessOnSelected([work], synchronise=False), children=[companion, work])


def is_on(leaf: SkillLeaf[RouteBlackboard]) -> Callable[[], bool]:
    """Make a condition: the leaf's skill is RUNNING."""
    return lambda: leaf.handle is not None and leaf.handle.state is ExecutionState.RUNNING


def sees(leaf: SkillLeaf[RouteBlackboard]) -> Callable[[], bool]:
    """Make a condition: the leaf's depth map skill is RUNNING and obstacle messages arrive."""
    return lambda: is_on(leaf)() and leaf.handle is not None and leaf.handle.progress >= 1.0


def sideways_yaw_rad(blackboard: RouteBlackboard) -> float:
    """Return the heading for crabbing along the present leg: the LiDAR's scan plane then holds the direction of travel."""
    return wrap_rad(blackboard.route.leg_heading_rad() + math.pi / 2)
