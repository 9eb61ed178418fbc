"""The mission of the paper's sections 2.1 and 6.2: fly all around a building as long as the telepilot sees what the drone sees.

The tree (in the constructs of the paper's Figures 6, 7 and 10), top to bottom as it is flown::

    inspection mission ?
      inspect the building ->
        take off
        fly with the telepilot's video ||
          stream (video.stream)
          inspect, watched by the LiDAR ||
            watch with the LiDAR (lidar_depthmap)
            the telepilot sees -> LiDAR sees -> until the route is flown: waypoint writer -> face the wall (rotate_head,
              when needed) -> lock the heading (lock_head) || fly along the wall (goto) -> reached
        land
      the video was lost -> hover, land where it is
      give up: hover, land where it is

The route goes around the building counter-clockwise, so that its walls are on the left: the drone flies sideways with its nose, and
so its camera, towards the wall, and the LiDAR's scan plane, which is across the nose, lies in the direction of travel.

What was decided, and why:

- **The video criteria are missed** for longer than the patience: `stream` fails by the criterion's name, the leg under way is
  interrupted, the drone stops, hovers some seconds, and lands where it is. That is the safe end that the rules ask for, so the
  mission is accomplished in degraded mode.
- **The video encoder dies or hangs**: `stream` ends as LOST, another name than a bad radio has, and the end is the same: stop, hover,
  land. An encoder that is started again is not switched on again: what died once in this flight is not relied on.
- **The ground station dies**: to the drone that is a radio that is out, so the criteria are missed; the control link is lost with it,
  and 5 s after its last heartbeat the autopilot flies home, out of the hover or just before it: the two are about as quick. The
  mission is given up and waits for the landing.
- **Degraded zones**: the picture gets worse, `stream` goes on, and so does the flight.
- **The video comes back while it hovers**: it lands all the same. A radio that has failed once here will fail again, and a
  telepilot can't take over a flight that goes on and off with the picture.
- **Where it lands**: below the route, which keeps its distance from the walls; no leg crosses the building, so neither does a landing.
- **No video, no flight**: the route begins once the telepilot sees; before that the drone stays above the place of take-off.
- **The sensor that looks ahead (LiDAR) fails**: flying on blind is out of the question, and turning the nose into the direction
  of travel, for the ZED, would end the inspection. The mission is given up: stop, hover, land. The ZED is not needed.
- **BLOCKED** on a leg: one more attempt after 2 s, then the mission is given up.
- **The control link is lost**: the autopilot's own failsafe flies home and lands. That takes the authority away from us, so
  the mission is given up and commands nothing; it ends when the vehicle is on the ground. The same when the pilot takes over; a vehicle
  that is given back is landed where it is, as in the mapping mission.
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
    """How the mission flies: metres, m/s, rad/s, seconds of mission clock, frames per second, structural similarity."""

    min_fps: float = 8.0
    min_quality: float = 0.4
    patience_s: float = 3.0
    hover_s: float = 4.0


@dataclass(frozen=True)
class Clients:
    """The skillsets that are called."""

    navigation: Client
    perception: Client
    video: Client


class InspectionMission:
    """The tree, and what its end means."""

    def __init__(self, clients: Clients, blackboard: RouteBlackboard, settings: Settings | None = None) -> None:
        self._clients = clients
        self._blackboard = blackboard
        self._settings = settings or Settings()
        self._flying = Flying(clients.navigation, blackboard, self._settings)
        self._lidar: SkillLeaf[RouteBlackboard] = SkillLeaf(
            "watch with the LiDAR", clients.perception, "lidar_depthmap", {}, blackboard=blackboard
        )
        self._stream: SkillLeaf[RouteBlackboard] = SkillLeaf("stream", clients.video, "stream", self._criteria(), blackboard=blackboard)
        self.land = self._flying.land("land")
        self.flight = self._inspect_the_building()
        stream_failed = Check("stream failed", self._stream_failed)
        self.video_lost = Sequence("the video was lost", memory=True, children=[stream_failed, self._flying.land_here()])
        note = Do("note why", RouteBlackboard.note_reason, blackboard=blackboard)
        give_up = Sequence("give up", memory=True, children=[note, self.stop_here()])
        self.giving_up = SuccessIsFailure("given up", give_up)
        self.root = Selector("inspection mission", memory=True, children=[self.flight, self.video_lost, self.giving_up])

    @property
    def degraded(self) -> bool:
        """Tell whether the flight ended early because the video was lost."""
        return self._stream_failed()

    @property
    def stopping(self) -> bool:
        """Tell whether the vehicle is landing."""
        return Status.RUNNING in {self.land.status, self.video_lost.status, self.giving_up.status}

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start, met or not."""
        lidar = self._clients.perception.resources.get("lidar_status", "UNKNOWN")
        told = "nothing is known of the LiDAR" if lidar == "UNKNOWN" else "the LiDAR is broken, nothing would look ahead"
        link = self._clients.video.resources.get("link", "UNKNOWN")
        silent = "neither the video encoder nor the ground station has been" if link == "UNKNOWN" else "the ground station is not"
        return [
            *conditions_of_flight(self._clients.navigation, vars(self._clients).values(), self._blackboard),
            condition("the LiDAR works", holds=lidar == "OK", otherwise=told + self._blackboard.because("perception.lidar_status")),
            condition("the ground station is heard (link)", holds=link == "UP", otherwise=f"{silent} heard of (link)"),
        ]

    def stop_here(self) -> Behaviour:
        """Make a tree that stops the vehicle and lands it where it is; also what an abort from outside ends with."""
        return self._flying.stop_here()

    # --- the tree, from the root down --------------------------------------------------------------------------------

    def _inspect_the_building(self) -> Sequence:
        watched = Sequence("when both see", memory=True, children=[*self._seeing(), self._all_around()])
        inspect = beside("inspect, watched by the LiDAR", watched, self._lidar)
        fly = beside("fly with the telepilot's video", inspect, self._stream)
        return Sequence("inspect the building", memory=True, children=[self._flying.take_off(), fly, self.land])

    def _seeing(self) -> list[Behaviour]:
        return [Check("the telepilot sees", sees(self._stream), wait=True), Check("LiDAR sees", sees(self._lidar), wait=True)]

    def _all_around(self) -> Behaviour:
        flying = self._flying
        lock = flying.lock_sideways()
        locked = Check("heading is locked", is_on(lock), wait=True)
        along = Sequence("along the wall", memory=True, children=[locked, flying.leg("fly", "goto")])
        leg = [flying.next_waypoint(), flying.turn_sideways("face the wall"), beside("fly facing the wall", along, lock), flying.reached()]
        return flying.until_flown(Sequence("leg", memory=True, children=leg))

    def _criteria(self) -> Mapping[str, object]:
        settings = self._settings
        return {"min_fps": settings.min_fps, "min_quality": settings.min_quality, "patience": settings.patience_s}

    def _stream_failed(self) -> bool:
        """Tell whether it was the video that ended the flight: it failed before anything else did."""
        failures = self._blackboard.failures
        return bool(failures) and failures[0].skill == self._stream.skill_name


def plan(inputs: Inputs) -> MissionPlan:
    """Return the mission along the route of its inputs."""
    names = ("navigation", "perception", "video")

    def make_tree(clients: Mapping[str, Client], blackboard: RouteBlackboard, settings: Settings) -> InspectionMission:
        return InspectionMission(Clients(*(clients[name] for name in names)), blackboard, settings)

    return route_plan("inspection", names, make_tree, Settings(), inputs)
