"""What all missions of the drone are made of: take off, fly to the waypoints of a route, stop and land; and their conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import FailureIsSuccess

from alula.missions.conditions import Condition, condition
from alula.missions.decorators import RetryAfter, Until
from alula.missions.leaves import Awaits, Check, Do, SkillLeaf, Stays
from alula.missions.skillset import Client
from alula.model.execution_state import ExecutionState
from uav_missions.blackboard import RouteBlackboard, WaypointWriter
from uav_missions.reasons import AUTHORITY
from uav_missions.route import wrap_rad

AUTHORITY_INVARIANTS = frozenset({"keep_sdk_authority", "sdk_authority"})
HEADING_TOLERANCE_RAD = 0.06


@dataclass(frozen=True, kw_only=True)
class FlightSettings:
    """How a mission flies: metres, m/s, rad/s, seconds of mission clock."""

    takeoff_height_m: float = 3.0
    takeoff_speed_m_s: float = 2.0
    speed_m_s: float = 1.0
    turn_rate_rad_s: float = 0.6
    blocked_wait_s: float = 2.0
    hover_s: float = 2.0
    settle_s: float = 3.0
    landing_chances: int = 10
    others_landing_s: float = 180.0
    """How long to wait for the pilot, or the autopilot's own failsafe, to land what we may not command, or to give it back."""


class Flying:
    """Makes parts of trees over the skillset `navigation`."""

    def __init__(self, navigation: Client, blackboard: RouteBlackboard, settings: FlightSettings) -> None:
        self._navigation = navigation
        self._blackboard = blackboard
        self._settings = settings

    def skill(
        self,
        name: str,
        skill: str,
        inputs: Mapping[str, object] | Callable[[RouteBlackboard], Mapping[str, object]] | None = None,
        *,
        success: str = "",
        on_success: Callable[[RouteBlackboard], None] | None = None,
    ) -> SkillLeaf[RouteBlackboard]:
        """Make a leaf of a skill of navigation; an empty ``success``: it is meant to run until it is interrupted."""
        results = {success} if success else set()
        after = on_success or (lambda _blackboard: None)
        return SkillLeaf(name, self._navigation, skill, inputs or {}, blackboard=self._blackboard, success=results, on_success=after)

    def take_off(self) -> Behaviour:
        """Return a leaf that climbs to ``takeoff_height_m`` at ``takeoff_speed_m_s``."""
        climb = {"height": self._settings.takeoff_height_m, "speed": self._settings.takeoff_speed_m_s}
        return self.skill("take off", "takeoff", climb, success="AT_ALTITUDE")

    def land(self, name: str) -> SkillLeaf[RouteBlackboard]:
        """Return a leaf of this name that lands where the vehicle is."""
        return self.skill(name, "land", success="LANDED")

    def stop_here(self) -> Behaviour:
        """Make a tree that stops the vehicle and lands it where it is, however often it is taken; what giving up and an abort end with."""
        return RetryAfter(
            "again when it is taken again",
            self.land_here(),
            chances=self._settings.landing_chances,
            wait_s=0.0,
            worth_it=lambda: not self.ours() and not self.on_ground(),
            blackboard=self._blackboard,
        )

    def land_here(self) -> Behaviour:
        """Make a tree that stops the vehicle and lands it where it is; it fails when the vehicle is taken while it does.

        A vehicle that is not ours is left alone until it is down. One that is given back meanwhile (the pilot chooses GUIDED, the link
        holds again) would hover for long: it is landed, too.
        """
        settings = self._settings
        hover = self.skill("hover", "hover", {"duration": settings.hover_s}, success="DONE")
        land = RetryAfter(
            "until it lands",
            self.land("land here"),
            chances=settings.landing_chances,
            wait_s=settings.blocked_wait_s,
            worth_it=self.ours,
            blackboard=self._blackboard,
        )
        on_ground = Stays("stays on the ground", self.on_ground, settings.settle_s, blackboard=self._blackboard)
        down = Selector("come down", memory=True, children=[on_ground, land])
        stop = Sequence("stop and land", memory=True, children=[FailureIsSuccess("if it can", hover), down])
        # For a while: a navigation that was restarted does not know yet that the vehicle is ours.
        taken = Stays("the pilot has control", lambda: not self.obeys(), settings.settle_s, blackboard=self._blackboard)
        # An autopilot that restarts in the air says at once that it stands: the record goes on until it does.
        ends = [("they land it", self.on_ground), ("they give it back", self.ours)]
        wait = [
            Awaits(what, comes, settings.others_landing_s, held_s=settings.settle_s, blackboard=self._blackboard) for what, comes in ends
        ]
        lands = Parallel("the pilot or the autopilot acts", policy=ParallelPolicy.SuccessOnOne(), children=wait)
        theirs = Check("is down, or still theirs", lambda: self.on_ground() or not self.ours())
        leave = Sequence("leave it to them", memory=True, children=[taken, FailureIsSuccess("or not", lands), theirs])
        return Selector("land where it is", memory=True, children=[leave, stop])

    # --- legs --------------------------------------------------------------------------------------------------------

    def next_waypoint(self) -> Behaviour:
        """Write the next waypoint of the route."""
        return WaypointWriter("waypoint writer", blackboard=self._blackboard)

    def reached(self) -> Behaviour:
        """Note that the waypoint was reached."""
        return Do("waypoint reached", lambda blackboard: blackboard.route.mark_reached(), blackboard=self._blackboard)

    def until_flown(self, leg: Behaviour) -> Behaviour:
        """Repeat the leg until the route is flown."""
        return Until("until the route is flown", leg, lambda: self._blackboard.route.done)

    def leg(self, name: str, skill: str) -> Behaviour:
        """Fly to the waypoint, with a second attempt when something is in the way."""
        leaf = self.skill(name, skill, self._goto_inputs, success="ARRIVED")
        return RetryAfter(
            "twice when blocked",
            leaf,
            chances=2,
            wait_s=self._settings.blocked_wait_s,
            worth_it=lambda: leaf.handle is not None and leaf.handle.result == "BLOCKED",
            blackboard=self._blackboard,
        )

    def turn_sideways(self, name: str) -> Behaviour:
        """Turn the nose to the left of the leg's direction, when it is elsewhere."""
        inputs = lambda board: {"heading": sideways_yaw_rad(board), "rate": self._settings.turn_rate_rad_s}  # noqa: E731
        rotate = self.skill("rotate the head", "rotate_head", inputs, success="ALIGNED", on_success=_note_yaw)
        return Selector(name, memory=True, children=[Check("is sideways", self._is_sideways), rotate])

    def lock_sideways(self) -> SkillLeaf[RouteBlackboard]:
        """Return a leaf that locks the heading across the present leg."""
        return self.skill("lock the heading", "lock_head", lambda board: {"heading": sideways_yaw_rad(board)})

    # --- what leaves ask and tell ------------------------------------------------------------------------------------

    def obeys(self) -> bool:
        """Tell whether the vehicle is ours to command: it is now, and has been since the mission began."""
        taken = any(failure.result in AUTHORITY_INVARIANTS for failure in self._blackboard.failures)
        return not taken and self.ours()

    def ours(self) -> bool:
        """Tell whether the vehicle is ours to command now, be it that it was given back."""
        return self._navigation.resources.get("SDK_authority") == "AVAILABLE"

    def on_ground(self) -> bool:
        """Tell whether the vehicle is on the ground."""
        return self._navigation.resources.get("flight_status") == "ON_GROUND"

    def _goto_inputs(self, blackboard: RouteBlackboard) -> Mapping[str, object]:
        x, y, z = blackboard.waypoint or (math.nan, math.nan, math.nan)
        return {"target": {"x": x, "y": y, "z": z}, "speed": self._settings.speed_m_s}

    def _is_sideways(self) -> bool:
        yaw_rad = self._blackboard.aligned_yaw_rad
        return yaw_rad is not None and abs(wrap_rad(yaw_rad - sideways_yaw_rad(self._blackboard))) < HEADING_TOLERANCE_RAD


def conditions_of_flight(navigation: Client, clients: Iterable[Client], blackboard: RouteBlackboard) -> list[Condition]:
    """Return what any mission needs to start."""
    state = navigation.resources.get
    grounded = state("flight_status") == "ON_GROUND"
    authority = "the autopilot is not ready, or not ours to command (SDK_authority)" + blackboard.because(AUTHORITY)
    return [
        *(
            condition(f"the skillset {one.skillset} answers", holds=one.ready, otherwise=f"the skillset {one.skillset} can't be called")
            for one in clients
        ),
        condition("the autopilot is ready and ours to command", holds=state("SDK_authority") == "AVAILABLE", otherwise=authority),
        condition("the home point is valid", holds=state("homepoint_status") == "VALID", otherwise="the home point is not valid"),
        condition("the vehicle is on the ground", holds=grounded, otherwise="the vehicle is not on the ground"),
    ]


def beside(name: str, work: Behaviour, companion: Behaviour) -> Parallel:
    """Run a companion as long as the work takes: it is started first and interrupted last, and the work fails with it."""
    return Parallel(name, policy=ParallelPolicy.SuccessOnSelected([work], synchronise=False), children=[companion, work])


def is_on(leaf: SkillLeaf[RouteBlackboard]) -> Callable[[], bool]:
    """Make a condition: the leaf's skill is RUNNING."""
    return lambda: leaf.handle is not None and leaf.handle.state is ExecutionState.RUNNING


def sees(leaf: SkillLeaf[RouteBlackboard]) -> Callable[[], bool]:
    """Make a condition: the leaf's skill is RUNNING with progress 1, as one that sees says that it does."""
    return lambda: is_on(leaf)() and leaf.handle is not None and leaf.handle.progress >= 1.0


def sideways_yaw_rad(blackboard: RouteBlackboard) -> float:
    """Return the heading for crabbing along the present leg: the LiDAR's scan plane then holds the direction of travel."""
    return wrap_rad(blackboard.route.leg_heading_rad() + math.pi / 2)


def _note_yaw(blackboard: RouteBlackboard) -> None:
    blackboard.aligned_yaw_rad = sideways_yaw_rad(blackboard)
