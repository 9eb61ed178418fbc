"""The autopilot proper, without any protocol: modes, arming, take-off, landing, failsafes, and the flight that follows from them.

Frames: ENU and FLU. Times: simulated seconds since the clock began; the autopilot has had power for longer (``boot_before_s``).
The numbers in brackets are those of the observed behaviours of ArduCopter that each method reproduces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from uav_simulator.autopilot.estimator import ALIGNED_AFTER_S, LOCATED_AFTER_S, PERFECT, Estimator
from uav_simulator.autopilot.failsafe import Failsafes
from uav_simulator.autopilot.ground_contact import TouchDown
from uav_simulator.autopilot.navigator import Goal, Navigator
from uav_simulator.autopilot.params import Parameters
from uav_simulator.autopilot.return_home import ReturnHome
from uav_simulator.autopilot.setpoint import RawSetpoint, read_setpoint
from uav_simulator.autopilot.sticks import Deflection, Sticks
from uav_simulator.autopilot.types import LandedState, Mode, Notice, Result, Severity, SystemStatus, Text
from uav_simulator.frames import Vec3, wrap_pi
from uav_simulator.imperfections import Imperfections
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.controller import Gains, PositionLoop
from uav_simulator.vehicle.hexacopter import Hexacopter

SPOOL_UP_S = 2.4
DISARM_AFTER_LANDING_S = 0.5
SLOW_LANDING_BELOW_M = 10.0
MANUAL = (Mode.STABILIZE, Mode.ALT_HOLD)  # need no position
UNLOCATED = (*MANUAL, Mode.LAND)  # can be flown in the air without a position
EARLY_S, EARLY_STAY_S = 2.0, 1.4  # a mode that needs a position and is taken so early after power-up does not stay
PREARM_PERIOD_S = 30.0  # of the texts that say what is missing
STEERED = (Mode.LOITER, Mode.POSHOLD)  # where the pilot's sticks fly
NOT_ARMABLE = (Mode.AUTO, Mode.RTL, Mode.LAND, Mode.BRAKE)
FENCE_BRAKE = 4.0  # FENCE_ACTION
FORCE_MAGIC = 21196.0  # param2 of MAV_CMD_COMPONENT_ARM_DISARM


@dataclass
class Takeoff:
    """A take-off under way: the height to reach above the origin, when it was accepted, whether it has lifted off."""

    height_m: float
    accepted_s: float
    lifted: bool = False


class Autopilot:
    """Flies a hexacopter; ``step`` every 20 ms."""

    def __init__(
        self,
        vehicle: Hexacopter,
        airframe: Airframe,
        *,
        seed: int,
        boot_before_s: float,
        params: Mapping[str, float] | None = None,
        imperfections: Imperfections = PERFECT,
    ) -> None:
        self._vehicle = vehicle
        self._boot_before_s = boot_before_s
        self.params = Parameters(params)
        self.estimator = Estimator(seed, imperfections)
        self.estimate = self.estimator.step(vehicle.body, 0.0)
        self._position_loop = PositionLoop(airframe, Gains())
        self._touch_down = TouchDown(airframe.hover_thrust_n)
        self._navigator = Navigator(self.params)
        self.now_s = 0.0
        self.mode = Mode.STABILIZE
        self.armed = False
        self.landed = True
        self.home: Vec3 | None = None
        self.flown_s = 0.0
        self._failsafes = Failsafes(self.params)
        self._sticks = Sticks(self.params)
        self._steering = False
        self._turning_rad_s = 0.0
        self._takeoff: Takeoff | None = None
        self._landed_since_s = 0.0
        self._return: ReturnHome | None = None
        self._texts: list[Text] = []
        self._notices: list[Notice] = []
        self._falls_back_s = math.inf
        self._prearm_due_s = 0.0
        self._thrust_lost = False
        if self.located:
            self.home = self.estimate.position

    # --- what a client can see ---------------------------------------------------------------------------------------

    @property
    def boot_s(self) -> float:
        """Return the seconds since power-up."""
        return self.now_s + self._boot_before_s

    @property
    def has_origin(self) -> bool:
        """Return whether there has been a position since power-up: its origin stays [4, 9]."""
        return self.boot_s >= LOCATED_AFTER_S

    @property
    def located(self) -> bool:
        """Return whether the estimator has a position [4, 18]."""
        return self.has_origin and not self.estimator.satellites.given_up

    @property
    def ready(self) -> bool:
        """Return whether the pre-arm checks pass: the estimator has settled, and has a position where the mode needs one [4]."""
        return self.boot_s >= ALIGNED_AFTER_S if self.mode in MANUAL else self.located

    @property
    def landed_state(self) -> LandedState:
        """Return MAV_LANDED_STATE as the autopilot publishes it [8]."""
        if self.landed:
            return LandedState.ON_GROUND
        if self.mode is Mode.LAND or (self._return and self._return.landing):
            return LandedState.LANDING
        return LandedState.TAKING_OFF if self._takeoff else LandedState.IN_AIR

    @property
    def system_status(self) -> SystemStatus:
        """Return MAV_STATE: critical as long as a failsafe's cause lasts [10]."""
        if self._failsafes.active:
            return SystemStatus.CRITICAL
        return SystemStatus.STANDBY if self.landed else SystemStatus.ACTIVE

    @property
    def goal(self) -> Goal:
        """Return where the autopilot is flying to."""
        return self._navigator.goal

    @property
    def yaw_target_rad(self) -> float:
        """Return the heading of the moving reference."""
        return self._navigator.yaw_rad

    def take_texts(self) -> list[Text]:
        """Return the texts since the last call."""
        texts, self._texts = self._texts, []
        return texts

    def take_notices(self) -> list[Notice]:
        """Return the notices since the last call."""
        notices, self._notices = self._notices, []
        return notices

    # --- commands ----------------------------------------------------------------------------------------------------

    def set_mode(self, number: int) -> Result:
        """Change the mode: by a client's request or the pilot's switch, which the autopilot does not distinguish [3, 11]."""
        if number not in [m.value for m in Mode]:
            return self._refused(f"No such mode {number}")
        mode = Mode(number)
        if mode is Mode.AUTO:
            return self._refused("Mode change to AUTO failed: init failed")
        if self.armed and self.has_origin and not self.located and mode not in UNLOCATED:
            return self._refused(f"Mode change to {mode.name} failed: requires position")
        if mode is not self.mode:
            self._enter(mode)
            early = self.boot_s < EARLY_S and mode not in MANUAL
            self._falls_back_s = self.now_s + EARLY_STAY_S if early else math.inf
        return Result.ACCEPTED

    def arm(self, *, force: bool = False) -> Result:
        """Arm, and make this place home [4, 9]."""
        if self.armed:
            return Result.ACCEPTED
        if not self.ready and not force:
            return self._refused(f"Arm: {self._missing}")
        if self.mode in NOT_ARMABLE:
            return self._refused(f"Arm: {self.mode.name} mode not armable")
        self._say(Severity.INFO, "Arming motors")
        self.armed = True
        self._landed_since_s = self.now_s
        self._set_home()
        self._notices.append(Notice.HEARTBEAT)
        return Result.ACCEPTED

    def disarm(self, *, force: bool = False) -> Result:
        """Stop the motors; in the air only by force [4]."""
        if not self.armed:
            return Result.ACCEPTED
        if not self.landed and not force:
            return self._refused("Disarm: vehicle is flying")
        self._say(Severity.INFO, "Disarming motors")
        self.armed = False
        self._takeoff = None
        self._notices.append(Notice.HEARTBEAT)
        return Result.ACCEPTED

    def take_off(self, height_m: float) -> Result:
        """Begin a take-off to a height above home [5]."""
        home_z = self.home[2] if self.home else 0.0
        target = home_z + height_m
        if not self.armed or self.mode is not Mode.GUIDED or not self.landed:
            return self._refused("Takeoff: vehicle must be armed, in GUIDED and on the ground")
        if not math.isfinite(target) or target <= self.estimate.position[2]:
            return self._refused("Takeoff: height must be above the vehicle")
        self._takeoff = Takeoff(target, self.now_s)
        return Result.ACCEPTED

    def condition_yaw(self, yaw_rad: float, *, relative: bool, turn: int, speed_rad_s: float) -> Result:
        """Turn the nose (counter-clockwise from east; ``turn`` 1 counter-clockwise, -1 clockwise, 0 the shorter way) [7]."""
        nav = self._navigator
        if speed_rad_s > 0.0:
            nav.yaw_speed_rad_s = min(speed_rad_s, math.radians(self.params["ATC_SLEW_YAW"] / 100.0))
        nav.look(wrap_pi(nav.yaw_rad + yaw_rad) if relative else yaw_rad, turn=turn)
        return Result.ACCEPTED

    def change_speed(self, axis: str, speed_m_s: float) -> Result:
        """Limit the speed `horizontal`, `up` or `down` until the mode is entered again."""
        if not speed_m_s > 0.0:
            return Result.DENIED
        self._navigator.speeds_m_s[axis] = speed_m_s
        return Result.ACCEPTED

    def setpoint(self, raw: RawSetpoint) -> None:
        """Follow a setpoint, or ignore it without a reply [5, 6, 7, 11]."""
        if self.mode is not Mode.GUIDED or not self.armed:
            return
        self._takeoff = None
        if self.landed:
            return
        nav = self._navigator
        setpoint = read_setpoint(raw, self.estimate)
        if setpoint is None:
            nav.stop()
            nav.hold_yaw()
            return
        p = setpoint.position
        expires_s = math.inf if setpoint.velocity is None else self.now_s + self.params["GUID_TIMEOUT"]
        nav.goal = Goal((p[0], p[1]) if p else None, p[2] if p else None, setpoint.velocity or (0.0, 0.0, 0.0), expires_s)
        if setpoint.yaw_rad is not None:
            nav.look(setpoint.yaw_rad)
        elif setpoint.yaw_rate_rad_s is not None:
            nav.yaw_rate = setpoint.yaw_rate_rad_s
        else:
            nav.look_along_travel()

    # --- what happens to it ------------------------------------------------------------------------------------------

    def hear_gcs(self) -> None:
        """Record a heartbeat of the ground station [10]."""
        if self._failsafes.hear_gcs(self.now_s):
            self._say(Severity.WARNING, "GCS Failsafe Cleared")

    def set_rc(self, *, lost: bool) -> None:
        """Lose or regain the remote control: RTL, which stays when it comes back [10]."""
        if self._failsafes.set_rc(lost=lost):
            self._fail_safe("Radio Failsafe")

    def manual_control(self, raw: Deflection) -> None:
        """Apply the sticks of the ground station; they fly in modes of the pilot's, in GUIDED they turn the nose alone [11]."""
        self._sticks.move(raw, self.now_s)

    def throttle_stick(self, up: float) -> None:
        """Leave the throttle of the remote control at -1 (zero) to 1; 0 holds the height [11]."""
        self._sticks.set_throttle(up)

    def yaw_stick(self, rate_rad_s: float) -> None:
        """Turn by the pilot's stick until it is centred, 0 [11]."""
        self._navigator.yaw_stick_rad_s = rate_rad_s
        if rate_rad_s == 0.0 and self._navigator.yaw_target is not None:
            self._navigator.look(wrap_pi(self._navigator.yaw_target))

    def step(self, now_s: float, dt_s: float) -> None:
        """Decide and set the vehicle's targets for the next period."""
        had_origin = self.has_origin
        self.now_s = now_s
        self.estimate = self.estimator.step(self._vehicle.body, dt_s)
        if self.has_origin and not had_origin:
            self._notices.append(Notice.ORIGIN)
            self._set_home()
        self._wait_for_readiness()
        if self.armed and self._failsafes.gcs_falls_silent(now_s):
            self._fail_safe("GCS Failsafe")
        if self.armed and not self.landed and self._failsafes.fence_breaks(self.estimate.position, self.home):
            self._leave_fence()
        self._watch_position(dt_s)
        self._watch_motors()
        self._follow_sticks()
        self._progress_takeoff()
        self._progress_landing()
        self._watch_touch_down(dt_s)
        self._watch_disarm()
        self._fly(now_s, dt_s)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _say(self, severity: Severity, text: str) -> None:
        self._texts.append(Text(severity, text))

    def _refused(self, text: str) -> Result:
        self._say(Severity.CRITICAL, text)
        return Result.FAILED

    @property
    def _missing(self) -> str:
        """Return what the pre-arm checks miss, in ArduCopter's words."""
        return "Need Position Estimate" if self.boot_s >= ALIGNED_AFTER_S else "AHRS: not using configured AHRS type"

    def _wait_for_readiness(self) -> None:
        """Say now and then what is missing; leave a mode that was taken too early [4]."""
        if self.now_s >= self._falls_back_s:
            self._falls_back_s = math.inf
            if not self.armed and self.mode not in MANUAL:
                self._enter(Mode.STABILIZE)
        if self.ready or self.armed:
            self._prearm_due_s = self.now_s
        elif self.now_s >= self._prearm_due_s and self.boot_s >= EARLY_S:
            self._prearm_due_s = self.now_s + PREARM_PERIOD_S
            self._say(Severity.CRITICAL, f"PreArm: {self._missing}")

    def _set_home(self) -> None:
        self.home = self.estimate.position
        self._notices.append(Notice.HOME)

    def _enter(self, mode: Mode) -> None:
        """Enter a mode: hold, and whatever the mode adds."""
        self.mode = mode
        self._notices.append(Notice.HEARTBEAT)
        self._takeoff = None
        self._return = None
        nav = self._navigator
        nav.reset_speeds()
        if mode in STEERED:
            pilot_m_s = self.params["PILOT_SPEED_UP"] / 100.0
            nav.speeds_m_s = {"horizontal": self.params["LOIT_SPEED"] / 100.0, "up": pilot_m_s, "down": pilot_m_s}
        nav.hold_yaw()
        nav.stop()
        if mode is Mode.RTL and self.home:
            self._return = ReturnHome(self.params, nav.goal, self.estimate.position, self.home)

    def _descend(self) -> None:
        height = self.estimate.position[2] - (self.home[2] if self.home else 0.0)
        speed = self.params["LAND_SPEED"] if height < SLOW_LANDING_BELOW_M else self.params["WPNAV_SPEED_DN"]
        goal = self._navigator.goal
        goal.z, goal.velocity = None, (0.0, 0.0, -speed / 100.0)

    def _fail_safe(self, cause: str) -> None:
        """Return home, or disarm on the ground; a landing goes on [10]."""
        self._say(Severity.WARNING, cause)
        if self.armed and self.landed:
            self.disarm()
        elif self.armed and self.mode is not Mode.LAND:
            self.set_mode(Mode.RTL if self.located else Mode.LAND)

    def _watch_position(self, dt_s: float) -> None:
        """Land without a position, where the mode needs one; a landing goes on [18]."""
        flying = self.armed and not self.landed
        if self._failsafes.position_fails(dt_s, located=self.located or not flying) and self.mode not in UNLOCATED:
            self.set_mode(Mode.LAND)
            self._say(Severity.CRITICAL, "EKF Failsafe: changed to LAND Mode")

    def _watch_motors(self) -> None:
        """Tell of a motor that has stopped in the air, and go on all the same [19]."""
        rotor = self._vehicle.body.stopped_rotor
        lost = rotor is not None and (self._thrust_lost or (self.armed and not self.landed))
        if lost and not self._thrust_lost:
            self._say(Severity.EMERGENCY, f"Potential Thrust Loss ({(rotor or 0) + 1})")
        self._thrust_lost = lost

    def _leave_fence(self) -> None:
        """Return home, or hover where it is for ever [19]; a landing goes on."""
        self._say(Severity.NOTICE, "Fence Breached")
        if self.mode is not Mode.LAND:
            self.set_mode(Mode.BRAKE if self.params["FENCE_ACTION"] == FENCE_BRAKE else Mode.RTL)

    def _follow_sticks(self) -> None:
        """Fly by the ground station's sticks, and stop when they are centred, or were not received for too long."""
        stick, nav = self._sticks.at(self.now_s), self._navigator
        turning_rad_s = self._sticks.turn_rad_s(stick) if self.mode in {*STEERED, Mode.GUIDED} else 0.0
        if turning_rad_s != self._turning_rad_s:
            self._turning_rad_s = turning_rad_s
            self.yaw_stick(turning_rad_s)
        steering = self.mode in STEERED and not self.landed and stick.moves
        if steering:
            nav.goal = Goal(None, None, self._sticks.velocity_m_s(stick, nav.yaw_rad))
        elif self._steering and self.mode in STEERED:
            nav.stop()
        self._steering = steering

    def _progress_takeoff(self) -> None:
        """Spool up, lift off, and end the take-off at its height [5]."""
        takeoff, nav = self._takeoff, self._navigator
        if takeoff is None:
            return
        if not takeoff.lifted and self.now_s - takeoff.accepted_s >= SPOOL_UP_S:
            takeoff.lifted, self.landed = True, False
            self._touch_down.standing_s = 0.0
            self._position_loop.restart()
            nav.restart(self.estimate)
            nav.goal.z = takeoff.height_m
        if takeoff.lifted and self.estimate.position[2] > takeoff.height_m - 0.1 and abs(self.estimate.velocity[2]) < 0.3:
            self._takeoff = None

    def _progress_landing(self) -> None:
        """Descend in LAND, slowly near the ground, and at the end of a return."""
        if self.landed:
            return
        home_reached = self._return and self._return.step(self.now_s, self.estimate.position, self._navigator.goal)
        if self.mode is Mode.LAND or home_reached:
            self._descend()

    def _watch_touch_down(self, dt_s: float) -> None:
        """Land when the ground carries; never during a take-off [8], and not with a motor that has stopped [19]."""
        if self.landed or self._takeoff or self._thrust_lost:
            return
        landed = self._touch_down.step(self._vehicle.body, self._vehicle.target, dt_s)
        if self._touch_down.standing_s > 0.0:
            self._navigator.keep_above(self.estimate.position[2] - 0.5)
        if landed:
            self.landed = True
            self._landed_since_s = self.now_s
            self._position_loop.restart()

    def _watch_disarm(self) -> None:
        """Disarm after a landing by LAND or RTL, or after a while on the ground [4, 8]."""
        if not self.armed or not self.landed or self._takeoff:
            return
        landing = self.mode in {Mode.LAND, Mode.RTL}
        delay = DISARM_AFTER_LANDING_S if landing else self.params["DISARM_DELAY"]
        if self.now_s - self._landed_since_s >= delay:
            self.disarm()

    @property
    def _idling(self) -> bool:
        """Return whether the motors carry nothing: off, or the pilot's own throttle is at zero [11]."""
        return not self.armed or (self.mode is Mode.STABILIZE and self._sticks.at(self.now_s).up <= -1.0)

    def _fly(self, now_s: float, dt_s: float) -> None:
        if self._idling or self.landed:
            self._vehicle.target = None
            if not self.landed:
                self.landed = self._vehicle.body.on_ground  # fallen
                self._landed_since_s = now_s
            if self.landed:
                self._navigator.restart(self.estimate)
            return
        self.flown_s += dt_s
        reference = self._navigator.step(now_s, dt_s)
        reference = replace(reference, yaw_rad=reference.yaw_rad - self.estimate.yaw_error_rad)
        self._vehicle.target = self._position_loop.step(reference, self.estimate.position, self.estimate.velocity, dt_s)
