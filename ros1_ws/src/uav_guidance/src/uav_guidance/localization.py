"""Where the autopilot's local frame (`odom`) lies in the SLAM's frame (`map`): followed evenly, so that the vehicle never jumps."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from uav_guidance.frames import Quaternion, rotated, wrap, yaw_of
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import ZERO, Vec3

log = logging.getLogger(__name__)

SETTLED_S = 3.0  # since the mapping began; without a scan that fits it is lost after 2 s
LONGEST_STEP_S = 0.2  # after a pause of the clock the correction must not jump
UNIT_TOLERANCE = 1e-3
FARTHEST_M = 1e5  # a translation beyond is no vehicle's


@dataclass(frozen=True, slots=True)
class Correction:
    """T_map_odom as the guidance uses it: a turn about the vertical and a shift in metres. Both frames stay level."""

    yaw_rad: float = 0.0
    shift_m: Vec3 = ZERO

    @classmethod
    def between(cls, place_odom_m: Vec3, place_map_m: Vec3, yaw_rad: float) -> Correction:
        """Return the correction by which one place has these coordinates in the two frames."""
        return cls(wrap(yaw_rad), place_map_m - place_odom_m.turned(yaw_rad))

    def to_map(self, place_odom_m: Vec3) -> Vec3:
        """Return a place's coordinates in `map`."""
        return place_odom_m.turned(self.yaw_rad) + self.shift_m

    def to_odom(self, place_map_m: Vec3) -> Vec3:
        """Return a place's coordinates in `odom`."""
        return (place_map_m - self.shift_m).turned(-self.yaw_rad)


NO_CORRECTION = Correction()


@dataclass(frozen=True, slots=True)
class Transform:
    """T_map_odom as the mapping publishes it: rotation (x, y, z, w) and translation in metres."""

    rotation_xyzw: Quaternion
    translation_m: Vec3

    @property
    def valid(self) -> bool:
        """Whether it is a rigid motion: the quaternion of unit length, the translation a vehicle's; a number that is none is neither."""
        return self.translation_m.norm < FARTHEST_M and abs(math.hypot(*self.rotation_xyzw) - 1.0) < UNIT_TOLERANCE

    def level_at(self, place_odom_m: Vec3) -> Correction:
        """Return the correction that agrees with this transform at a place, without its roll and pitch.

        The small tilt between the two attitudes must not shift the vehicle: half a degree is 0.3 m in height, 40 m from the origin.
        """
        place_map_m = rotated(self.rotation_xyzw, place_odom_m) + self.translation_m
        return Correction.between(place_odom_m, place_map_m, yaw_of(self.rotation_xyzw))


class Localization:
    """Follow the mapping's T_map_odom while the mapping is sound (it runs, without a problem), at a bounded rate while the vehicle flies.

    Where the mapping is lost, stopped or silent, the last correction is kept: the autopilot's drift since then is not known, and an older
    correction is nearer to the truth than none. The rate bounds how the vehicle's own place and heading move in `map`, not the transform's
    numbers: a turn of 2 degrees moves a place 50 m from the origin by 1.7 m.
    """

    def __init__(self, settings: GuidanceSettings) -> None:
        self.correction = NO_CORRECTION
        self._settings = settings
        self._newest: Transform | None = None
        self._unconfirmed: Transform | None = None
        self._well = False
        self._scans = 0
        self._sound_since_s: float | None = None
        self._begun = False
        self._stepped_s: float | None = None
        self._above_m = self._level_m = self._begun_m = 0.0
        """The map's height above the autopilot's as received last, how much was followed for good, and what it was when that began."""

    def tune(self, settings: GuidanceSettings) -> None:
        """Set other settings."""
        self._settings = settings

    def hear_state(self, *, running: bool, problem: str, scans: int, now_s: float) -> None:
        """Handle the mapping's state, which comes with each sweep; ``problem``: why its pose is unreliable.

        The last transform counts from the first state after it that is sound. A mapping that begins is given time to settle, and so is one
        that was started again (it counts its scans from zero): it has to find itself in its saved map.
        """
        since_s, again = self._sound_since_s, scans < self._scans
        self._well, self._scans = not problem, scans
        if not running or problem:
            self._sound_since_s = None
        elif since_s is None or again or now_s < since_s:
            self._sound_since_s = now_s
        elif now_s - since_s >= SETTLED_S:
            self._newest = self._unconfirmed or self._newest
        self._unconfirmed = None

    def hear_transform(self, newest: Transform) -> None:
        """Handle the mapping's T_map_odom; the one present when the guidance has just started counts at once, unless the map is lost."""
        if not newest.valid:
            return
        if self._newest is None:
            self._newest = newest if self._well else None
        else:
            self._unconfirmed = newest

    def step(self, place_odom_m: Vec3, now_s: float, *, flying: bool) -> bool:
        """Move the correction on to this time; return whether it has jumped under a flying vehicle.

        It jumps to the first transform, which a guidance started again in flight hears, and to one that is farther off than
        ``map_jump_m`` or ``map_jump_rad``: then a loop was closed, or the autopilot counts from another origin. To follow that slowly
        would keep the vehicle off its places for long, and move one that holds its place. The caller begins again from where the vehicle
        is, so that no setpoint jumps. In flight a change of height is followed up to ``map_height_m``, and one that goes on at
        ``map_height_m_s``, in all up to ``map_height_most_m``: a barometer drifts by centimetres a second. A map that is worse than that,
        for it is not level or drifts itself, must not lead the vehicle to the ground.
        """
        passed_s = 0.0 if self._stepped_s is None else min(max(now_s - self._stepped_s, 0.0), LONGEST_STEP_S)
        self._stepped_s = now_s
        wanted = self._wanted(place_odom_m, passed_s, flying=flying)
        if wanted is None:
            return False
        here = self.correction.to_map(place_odom_m)
        shift, turn = wanted.to_map(place_odom_m) - here, wrap(wanted.yaw_rad - self.correction.yaw_rad)
        most_m, most_rad = self._settings.map_rate_m_s * passed_s, self._settings.map_rate_rad_s * passed_s
        if shift.norm <= most_m and abs(turn) <= most_rad:
            self.correction, self._begun = wanted, True
            return False
        jump = shift.norm > self._settings.map_jump_m or abs(turn) > self._settings.map_jump_rad
        if flying and self._begun and not jump:
            shift = shift * min(1.0, most_m / max(shift.norm, most_m, 1e-9))
            yaw_rad = self.correction.yaw_rad + min(max(turn, -most_rad), most_rad)
            self.correction = Correction.between(place_odom_m, here + shift, yaw_rad)
            return False
        self.correction, self._begun = wanted, True
        if flying:
            log.warning("the vehicle's place in map jumps by %.2f m and %.1f degrees", shift.norm, math.degrees(abs(turn)))
        return flying

    def _wanted(self, place_odom_m: Vec3, passed_s: float, *, flying: bool) -> Correction | None:
        if not self._settings.follow_map:
            return NO_CORRECTION
        if self._newest is None:
            return None
        told = self._newest.level_at(place_odom_m)
        above_m, before_m = told.shift_m.z, self._above_m
        self._above_m = above_m
        if not (flying and self._begun):
            self._level_m = self._begun_m = above_m
        elif abs(above_m - before_m) > self._settings.map_jump_m:
            self._level_m += above_m - before_m
            self._begun_m += above_m - before_m
        drift_m, in_all_m = self._settings.map_height_m_s * passed_s, self._settings.map_height_most_m
        self._level_m += min(max(above_m - self._level_m, -drift_m), drift_m)
        self._level_m = min(max(self._level_m, self._begun_m - in_all_m), self._begun_m + in_all_m)
        most_m = self._settings.map_height_m
        bounded_m = min(max(above_m, self._level_m - most_m), self._level_m + most_m)
        return Correction(told.yaw_rad, Vec3(told.shift_m.x, told.shift_m.y, bounded_m))
