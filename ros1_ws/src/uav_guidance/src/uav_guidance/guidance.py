"""The guidance's state machine: requests, the vehicle's messages and the time go in; commands and setpoints come out.

Everything is in `map` (ENU, metres); only what the autopilot says and is told is in its own frame, `odom`, and is converted where it comes
in and goes out. Times are seconds of the mission clock. Nothing here blocks, nothing here knows of ROS or sockets.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from uav_guidance.authority import Authority, AuthorityChange
from uav_guidance.commands import Command, Procedure, arm, disarm, set_mode, take_off
from uav_guidance.follower import Course, Follower, Setpoint
from uav_guidance.frames import wrap
from uav_guidance.localization import Correction, Localization, Transform
from uav_guidance.obstacles import Sighting
from uav_guidance.positioning import Positioning
from uav_guidance.readiness import Readiness
from uav_guidance.references import Hold, Land, Reference, Takeoff, Travel, Turn
from uav_guidance.requests import (
    AuthorityRequest,
    GuidanceDecision,
    HeadingRequest,
    HoverRequest,
    LandRequest,
    PositionRequest,
    Refusal,
    Request,
    StopRequest,
    TakeoffRequest,
    check_fence,
    check_flying,
    check_height,
    check_number,
    check_takeoff,
    require,
)
from uav_guidance.settings import GuidanceSettings
from uav_guidance.standing import GROUND_M, LOW_M, Standing, above_home_m
from uav_guidance.takeover import Takeover
from uav_guidance.vectors import Vec3
from uav_guidance.vehicle import Landed, Mode, VehicleSnapshot, in_map, leapt, mode_name, updated
from uav_guidance.wind import WindWatch

log = logging.getLogger(__name__)

PREARM_PREFIX = "PreArm: "


@dataclass(frozen=True)
class GuidanceStatus:
    """The guidance's state for its messages."""

    vehicle: VehicleSnapshot
    link: bool
    """Whether the vehicle's mode counts: a heartbeat has had it since the link is up."""
    authority: bool
    reference_id: int
    course: Course


class Guidance:
    """Follow one reference at a time, and a heading beside it, as long as the companion has the authority."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self.odometry = VehicleSnapshot()
        """The autopilot's own, in `odom`."""
        self._in_map: VehicleSnapshot | None = None
        self._settings = settings
        self._localization = Localization(settings)
        self._home_map_m: Vec3 | None = None
        self._leapt = False
        self._authority = Authority()
        self._heard_s: float | None = None
        self._readiness = Readiness()
        self._positioning = Positioning()
        self._wind = WindWatch()
        self._begun_s: float | None = None
        self._introduced = False
        self._follower = Follower(settings)
        self._reference_id = 0
        self._procedure: Procedure | None = None
        self._start_procedure: Procedure | None = None
        self._prearm_text = ""
        self._takeover = Takeover()
        self._standing = Standing()
        self._disarming: Procedure | None = None
        self._disarms = 0
        """How often the motors of a vehicle that stands in this landing were to be stopped."""
        self._notes: list[str] = []
        self._answers: dict[type[Request], Callable[[Any, float], GuidanceDecision]] = {
            TakeoffRequest: self._take_off,
            PositionRequest: self._set_position,
            HeadingRequest: self._set_heading,
            HoverRequest: self._hover,
            StopRequest: self._stop,
            LandRequest: self._land,
            AuthorityRequest: self._take_authority,
        }

    def tune(self, settings: GuidanceSettings) -> None:
        """Set other settings; the reference under way keeps those that it began with."""
        self._settings = settings
        self._localization.tune(settings)
        self._follower.tune(settings)

    @property
    def vehicle(self) -> VehicleSnapshot:
        """The vehicle's snapshot, in `map`; it is computed on access, which is rarer than messages."""
        if self._in_map is None:
            self._in_map = in_map(self.odometry, self.correction, self._home_map_m)
        return self._in_map

    @property
    def correction(self) -> Correction:
        """The transform T_map_odom in use."""
        return self._localization.correction

    # ---- what comes in -------------------------------------------------------------------------------------------------

    def on_message(self, message: Any, now_s: float) -> None:
        """Handle a MAVLink message of the autopilot."""
        kind = message.get_type()
        self._heard_s = now_s
        if kind == "COMMAND_ACK":
            if self._procedure is not None:
                self._procedure.on_answer(message.command, message.result, now_s)
            return
        before, self.odometry = self.odometry, updated(self.odometry, message, now_s)
        self._leapt |= leapt(before, self.odometry, self._settings.map_jump_m)
        self._keep_home(before)
        self._in_map = None
        if self.odometry.boots > before.boots:
            self._start_over(now_s)
        if self.odometry.mode != before.mode:
            self._takeover.mode_changed(now_s)
        if kind == "HEARTBEAT":
            self._authority.hear_heartbeat(self.vehicle)
            self._check_authority(now_s)
        elif kind == "SYS_STATUS":
            self._readiness.hear_checks(self.vehicle, now_s, held=self._authority.held)
            if self.vehicle.ready:
                self._prearm_text = ""
        if self._procedure is not None:
            self._procedure.on_vehicle(kind, self.vehicle)

    def on_text(self, severity: int, text: str, now_s: float) -> None:
        """Handle a whole STATUSTEXT of the autopilot."""
        self._takeover.hear_text(severity, text, now_s)
        if text.startswith(PREARM_PREFIX):
            self._prearm_text = text.removeprefix(PREARM_PREFIX)
        if self._procedure is not None:
            self._procedure.on_text(severity, text)

    def on_mapping(self, *, running: bool, problem: str, scans: int, now_s: float) -> None:
        """Handle the mapping's state; ``scans`` is how many it has taken since it was started."""
        self._localization.hear_state(running=running, problem=problem, scans=scans, now_s=now_s)

    def on_transform(self, newest: Transform) -> None:
        """Handle the newest T_map_odom of the mapping."""
        self._localization.hear_transform(newest)

    def on_obstacle(self, sighting: Sighting, now_s: float) -> None:
        """Handle a sensor's verdict on the corridor ahead."""
        self._follower.obstacles.see(sighting, now_s)

    def ask(self, request: Request, now_s: float) -> GuidanceDecision:
        """Accept a request or refuse it with a reason; a refused one changes nothing."""
        try:
            return self._answers[type(request)](request, now_s)
        except Refusal as refusal:
            return GuidanceDecision(accepted=False, reason=str(refusal))

    def fence_reason(self, target_enu_m: Vec3) -> str:
        """Return why a target is outside the fence; empty if it is inside."""
        try:
            check_fence(target_enu_m, self.vehicle, self._settings)
        except Refusal as refusal:
            return str(refusal)
        return ""

    # ---- what goes out -------------------------------------------------------------------------------------------------

    def step(self, now_s: float) -> list[Command | Setpoint]:
        """Advance to this time; return what to send now, in `odom`. Call it at 20 Hz, and whenever an input has arrived."""
        self._localize(now_s)
        self._check_authority(now_s)
        lost = self._positioning.step(self.odometry, now_s, lost_s=self._settings.position_lost_s)
        if lost and self.odometry.off_ground:
            self._note(f"the position is lost: {self._positioning.reason}")
        if strong := self._wind.step(self.odometry, now_s):
            self._note(strong)
        self._introduce(now_s)
        self._take_authority_at_start(now_s)
        command = self._procedure.due(now_s) if self._procedure is not None else None
        self._drop_what_ended(now_s)
        self._adopt_hover(now_s)
        self._stop_motors(now_s)
        setpoint = self._follower.step(self.vehicle, now_s, commanded=self._authority.held)
        return [item for item in (command, self._in_odom(setpoint)) if item is not None]

    def link(self, now_s: float) -> bool:
        """Return whether anything arrives from the autopilot; heartbeats alone may be seconds apart on a busy machine."""
        known = self._heard_s is not None and self.odometry.heartbeat_s is not None
        return known and abs(now_s - (self._heard_s or 0.0)) <= self._settings.link_lost_s

    def resources(self) -> dict[str, str]:
        """Return the states of navigation's resources that the hardware decides; what is not known is left out.

        Nothing is known before the vehicle has introduced itself: a guidance that was started again in flight must not take away from the
        skills what they rightly have, only because it has not heard of it yet.
        """
        if not self._introduced:
            return {}
        states = {
            "SDK_authority": "AVAILABLE" if self._authority.held and self._readiness.usable else "UNAVAILABLE",
            "homepoint_status": "VALID" if self.vehicle.home is not None else "INVALID",
        }
        if self.vehicle.landed is not Landed.UNDEFINED:
            states["flight_status"] = "ON_GROUND" if self.vehicle.on_ground else "IN_AIR"
        if self._positioning.known is not None:
            states["position_status"] = "KNOWN" if self._positioning.known else "LOST"
        return states

    def reasons(self, now_s: float) -> dict[str, str]:
        """Return the reasons of the resources' states where they are not obvious, as texts that stay while nothing else changes."""
        available = self._authority.held and self._readiness.usable
        reasons = {"position_status": self._positioning.reason} if self._positioning.reason else {}
        return reasons if available else {**reasons, "SDK_authority": self._lost_reason(now_s)}

    def report(self, now_s: float) -> GuidanceStatus:
        """Return the guidance's state."""
        return GuidanceStatus(
            vehicle=self.vehicle,
            link=self.link(now_s) and self._authority.mode_told,
            authority=self._authority.held,
            reference_id=self._reference_id,
            course=self._follower.course(self.vehicle, now_s),
        )

    # ---- requests ------------------------------------------------------------------------------------------------------

    def _take_off(self, request: TakeoffRequest, now_s: float) -> GuidanceDecision:
        self._require_authority(now_s)
        check_number("speed", request.speed_m_s, self._settings.max_speed_m_s)
        check_height(request.height_m, self._settings)
        check_takeoff(self.vehicle, self._prearm_text)
        reference = Takeoff(self._settings, height_m=request.height_m, speed_m_s=request.speed_m_s)
        return self._accept(reference, [*self._to_guided(), arm(self._prearm_text), take_off(request.height_m)], now_s)

    def _set_position(self, request: PositionRequest, now_s: float) -> GuidanceDecision:
        self._require_authority(now_s)
        check_number("speed", request.speed_m_s, self._settings.max_speed_m_s)
        check_flying(self.vehicle)
        check_fence(request.target_enu_m, self.vehicle, self._settings)
        require(not (request.along_travel and self._follower.heading.locked), "the heading is locked: it can't turn into the travel")
        reference = Travel(
            self._settings,
            target_enu_m=request.target_enu_m,
            speed_m_s=request.speed_m_s,
            along_travel=request.along_travel,
        )
        return self._accept(reference, self._to_guided(), now_s)

    def _set_heading(self, request: HeadingRequest, now_s: float) -> GuidanceDecision:
        if request.release:
            self._follower.heading.locked = False
            return GuidanceDecision(accepted=True, reference_id=self._reference_id)
        self._require_authority(now_s)
        require(math.isfinite(request.yaw_rad), f"yaw is {request.yaw_rad}: not a number")
        check_number("rate", request.rate_rad_s, self._settings.max_yaw_rate_rad_s)
        check_flying(self.vehicle)
        if request.lock:
            return self._lock_heading(request, now_s)
        require(not self._follower.heading.locked, "the heading is locked")
        return self._accept(Turn(self._settings, yaw_rad=request.yaw_rad, rate_rad_s=request.rate_rad_s), self._to_guided(), now_s)

    def _lock_heading(self, request: HeadingRequest, now_s: float) -> GuidanceDecision:
        """Set the heading beside the reference, which goes on and keeps its id."""
        self._adopt_hover(now_s)
        self._follower.lock_heading(request.yaw_rad, request.rate_rad_s, now_s)
        return GuidanceDecision(accepted=True, reference_id=self._reference_id)

    def _hover(self, _request: HoverRequest, now_s: float) -> GuidanceDecision:
        self._require_authority(now_s)
        if self.vehicle.on_ground:
            require(isinstance(self._follower.reference, Takeoff), "not in the air")
            return self._accept(Hold(self._settings), [disarm()], now_s)
        require(self.vehicle.off_ground, "the autopilot has not said whether it is in the air")
        require(self.vehicle.located, "the autopilot does not say where it is")
        if isinstance(self._follower.reference, Land):
            # A late request would lift a vehicle that is touching down, for the autopilot reports the ground seconds later.
            height_m = above_home_m(self.vehicle)
            require(height_m > LOW_M, f"it is landing, {height_m:.1f} m above home: a landing is not broken off so low")
        return self._accept(Hold(self._settings), self._to_guided(), now_s)

    def _stop(self, _request: StopRequest, now_s: float) -> GuidanceDecision:
        self._require_authority(now_s)
        on_ground = self.vehicle.on_ground and not isinstance(self._follower.reference, Takeoff)
        if on_ground or isinstance(self._follower.reference, Land):
            return GuidanceDecision(accepted=True, reference_id=self._reference_id)
        return self._hover(HoverRequest(), now_s)

    def _land(self, _request: LandRequest, now_s: float) -> GuidanceDecision:
        self._require_authority(now_s)
        require(self.vehicle.armed or self.vehicle.off_ground or isinstance(self._follower.reference, Takeoff), "on the ground already")
        if self._procedure is None and self.vehicle.mode == Mode.LAND and isinstance(self._follower.reference, Land):
            return GuidanceDecision(accepted=True, reference_id=self._reference_id)  # who watches this one goes on
        self._authority.ask_land()
        self._follower.heading.locked = False
        return self._accept(Land(), [set_mode(Mode.LAND)], now_s)

    def _take_authority(self, _request: AuthorityRequest, now_s: float) -> GuidanceDecision:
        require(self.link(now_s), "no link to the autopilot")
        require(not self.vehicle.foreign, self._foreign_reason())
        self._readiness.restarted = False
        if self._authority.held:
            return GuidanceDecision(accepted=True, reference_id=self._reference_id)
        self._run(Procedure([set_mode(Mode.GUIDED)]))
        return GuidanceDecision(accepted=True, reference_id=self._reference_id, procedure=self._procedure)

    def _require_authority(self, now_s: float) -> None:
        if self.vehicle.heartbeat_s is None:
            raise Refusal("no authority: nothing was heard of the autopilot")
        silent_s = 0.0 if self._heard_s is None else now_s - self._heard_s
        silence = "" if self.link(now_s) else f", nothing was heard of it for {silent_s:.1f} s"
        require(self._authority.held, f"no authority: {self._lost_reason(now_s)}{silence}")

    def _to_guided(self) -> list[Command]:
        in_guided = self.vehicle.mode == Mode.GUIDED and not self._authority.landing_unseen
        return [] if in_guided else [set_mode(Mode.GUIDED)]

    def _accept(self, reference: Reference, commands: Sequence[Command], now_s: float) -> GuidanceDecision:
        """Follow another reference from now on."""
        # Ids go on after a restart of the node: they begin at the mission clock's milliseconds.
        self._reference_id = max(self._reference_id + 1, int(now_s * 1000.0) & 0xFFFFFFF)
        self._run(Procedure(commands))
        self._follower.take(reference, self.vehicle, now_s)
        return GuidanceDecision(accepted=True, reference_id=self._reference_id, procedure=self._procedure)

    def _run(self, procedure: Procedure) -> None:
        if self._procedure is not None:
            self._procedure.abort("another command came")
        self._procedure = procedure

    # ---- at each step --------------------------------------------------------------------------------------------------

    def _localize(self, now_s: float) -> None:
        """Correct where the vehicle is in `map`; where that jumps in flight, the reference begins again from there.

        It jumps when the correction does, and when the autopilot's own estimate does, which the correction follows a sweep later: the
        vehicle must not be sent back, at the autopilot's own top speed, to a place that was wrong before or is wrong now.
        """
        place = self.odometry.position_enu_m
        if place is None:
            return
        flying = self.odometry.armed or not self.odometry.on_ground
        jumped = self._localization.step(place, now_s, flying=flying)
        if self._leapt and flying:
            log.warning("the autopilot's estimate of its place has jumped")
            jumped = True
        self._leapt = False
        if jumped and self._readiness.restarted:  # home, too, counts from the other origin
            self._set_home()
        self._in_map = None
        if jumped:
            self._follower.begin_again(self.vehicle, now_s)

    def _keep_home(self, before: VehicleSnapshot) -> None:
        """Keep where home was in `map` when the autopilot set it: the drift since then has moved its coordinates, not the place."""
        if self.odometry.home_enu_m != before.home_enu_m:
            self._set_home()

    def _set_home(self) -> None:
        home = self.odometry.home_enu_m
        self._home_map_m = None if home is None else self.correction.to_map(home)

    def _in_odom(self, setpoint: Setpoint | None) -> Setpoint | None:
        if setpoint is None:
            return None
        correction = self.correction
        return Setpoint(correction.to_odom(setpoint.position_enu_m), wrap(setpoint.yaw_rad - correction.yaw_rad))

    def _start_over(self, now_s: float) -> None:
        """Drop what was asked of an autopilot that has restarted since: it has forgotten it, and its origin may be another one.

        Where it comes back in GUIDED and in the air, the vehicle is held where it is, and can be landed; another mode is not ours. The
        skills get the authority back only when the pilot or the operator gives it: their places may be others now.
        """
        self._readiness.start_over()
        self._authority.start_over()
        log.warning("the autopilot has restarted, in %s", mode_name(self.vehicle.mode))
        if self._procedure is not None:
            self._procedure.abort("the autopilot has restarted")
        self._follower.heading.locked = False
        self._follower.take(None, self.vehicle, now_s)

    def _check_authority(self, now_s: float) -> None:
        """Drop everything when the pilot, a failsafe or a broken link takes the authority away; nothing is taken back."""
        change = self._authority.update(self.vehicle, link=self.link(now_s))
        if change is not AuthorityChange.NONE:
            self._readiness.authority_changed(now_s)
        self._readiness.update(self.vehicle, held=self._authority.held)
        if change is not AuthorityChange.LOST:
            return
        why = self._lost_reason(now_s)
        log.warning("authority lost: %s", why)
        if self._procedure is not None:
            self._procedure.abort(f"authority lost: {why}")
        self._follower.heading.locked = False
        self._follower.take(None, self.vehicle, now_s)

    def _lost_reason(self, now_s: float) -> str:
        """Return why there is no authority, or none of use: the link, a restart, the autopilot's own checks, or another mode than ours."""
        if not self.link(now_s):
            return "the link to the autopilot is lost"
        if not self._authority.mode_told:
            return "the link is back, the autopilot has not told its mode yet"
        if self.vehicle.foreign:
            return self._foreign_reason()
        mode = mode_name(self.vehicle.mode)
        if self._readiness.restarted:
            return f"the autopilot has restarted, in {mode}"
        if self._authority.held or (self.vehicle.on_ground and not self.vehicle.ready):
            return f"the vehicle stands in {mode}, its own checks are not passed"
        return self._takeover.reason(self.vehicle)

    def _foreign_reason(self) -> str:
        return f"the autopilot is {self.vehicle.foreign}: only ArduPilot on a multicopter is flown"

    def _introduce(self, now_s: float) -> None:
        """Note that mode, landed state, home and place are known, or that they don't come although there was time."""
        if self._begun_s is None or now_s < self._begun_s:  # a clock that was set back
            self._begun_s = now_s
        vehicle = self.vehicle
        complete = self.link(now_s) and vehicle.landed is not Landed.UNDEFINED and vehicle.home is not None and vehicle.located
        self._introduced |= complete or now_s - self._begun_s > self._settings.link_lost_s

    def _take_authority_at_start(self, now_s: float) -> None:
        """Take GUIDED once, when the vehicle stands ready on the ground; try again if no answer came, and later if it was refused."""
        running = self._start_procedure
        if running is not None and running.outcome is not None:
            if running.outcome.accepted:
                self._authority.settle_start()
            elif running.outcome.answered:
                log.warning("GUIDED at the start: %s", running.outcome.reason)
                self._authority.start_refused(now_s)
            self._start_procedure = None
        elif running is None and self._authority.wants_start(self.vehicle, now_s):
            self._start_procedure = Procedure([set_mode(Mode.GUIDED)])
            self._run(self._start_procedure)

    def _drop_what_ended(self, now_s: float) -> None:
        """Follow nothing if the autopilot did not agree, or if the vehicle stands on the ground, disarmed (a landing keeps its name)."""
        outcome = self._procedure.outcome if self._procedure is not None else None
        if outcome is not None and self._procedure is self._disarming:
            self._procedure = self._disarming = None  # the landing goes on, whatever came of it
            self._note("its motors are off" if outcome.accepted else outcome.reason)
        elif outcome is not None and not outcome.accepted:
            self._procedure = None
            if isinstance(self._follower.reference, Land):
                self._authority.withdraw_land()
            if self._follower.reference is not None and not self._follower.streaming:
                self._follower.take(None, self.vehicle, now_s)
        elif outcome is not None:
            self._procedure = None
            if not isinstance(self._follower.reference, Land):
                self._authority.withdraw_land()
        if self._procedure is None and self._follower.over(self.vehicle):
            self._follower.take(None, self.vehicle, now_s)

    def _stop_motors(self, now_s: float) -> None:
        """Disarm a vehicle that stands on the ground in a landing of ours that does not end; one that lies higher is only reported.

        First as any client may, then by force, for the autopilot takes it for flying.
        """
        landing = self._authority.held and isinstance(self._follower.reference, Land)
        if not landing:
            self._disarms = 0
        if not self._standing.step(self.vehicle, now_s, landing=landing) or self._procedure is not None:
            return
        self._standing.restart()
        height_m = above_home_m(self.vehicle)
        allowed = self._settings.disarm_standing and height_m <= GROUND_M
        if allowed or not self._disarms:
            what = "it is disarmed" if allowed else "it is not disarmed by itself"
            self._note(f"the vehicle stands still in LAND with its motors on, {height_m:.1f} m above home: {what}")
        if allowed:
            self._disarming = Procedure([disarm(force=self._disarms > 0)])
            self._run(self._disarming)
        self._disarms += 1

    def _note(self, words: str) -> None:
        log.warning(words)
        self._notes.append(words)

    def take_notes(self) -> list[str]:
        """Return the events since the last call that concern a person, in words."""
        notes, self._notes = self._notes, []
        return notes

    def _adopt_hover(self, now_s: float) -> None:
        """Stay in place when there is the authority but no reference, in the air: after a restart, or given back by the pilot."""
        flying = self.vehicle.landed is Landed.IN_AIR and self.vehicle.located and self.vehicle.mode == Mode.GUIDED
        if self._follower.reference is None and self._authority.held and flying:
            self._follower.take(Hold(self._settings), self.vehicle, now_s)
