"""Whether the autopilot has its position: its estimator's flags, and the satellites' fix that its position rests on.

Without a fix ArduCopter's estimator reckons on and tells its position as before, until its failsafe lands the vehicle after 8 s.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.vehicle import VehicleSnapshot

FRESH_S = 0.2  # an attitude of 50 Hz that is older: the streams were reset, or the link is slow, and silence says nothing of the GPS
BACK_S = 3.0  # for which all must be well until the position counts as known again


class Positioning:
    """Judges at each step of the guidance. Times are seconds of the mission clock."""

    def __init__(self) -> None:
        self.known: bool | None = None
        """None: the autopilot has not reported it."""
        self.reason = ""
        """Why it is not known: what was found first."""
        self._fix_s: float | None = None
        self._without_s = self._well_s = 0.0
        self._stepped_s: float | None = None

    def step(self, vehicle: VehicleSnapshot, now_s: float, *, lost_s: float) -> bool:
        """Judge the present state; return whether the position has been lost just now, as after ``lost_s`` seconds without a fix."""
        passed_s = 0.0 if self._stepped_s is None else max(now_s - self._stepped_s, 0.0)
        self._stepped_s = now_s
        if vehicle.fix_s != self._fix_s:
            self._fix_s, self._without_s = vehicle.fix_s, 0.0
        elif now_s - vehicle.attitude_s <= FRESH_S:
            self._without_s += passed_s
        if vehicle.estimator_flags is None and vehicle.fix_s is None:
            return False
        missing = self._missing(vehicle, lost_s)
        was_lost, self._well_s = self.known is False, 0.0 if missing else self._well_s + passed_s
        if missing:
            self.known, self.reason = False, self.reason or missing
        elif not was_lost or self._well_s >= BACK_S:
            self.known, self.reason = True, ""
        return self.known is False and not was_lost

    def _missing(self, vehicle: VehicleSnapshot, lost_s: float) -> str:
        """Return what is missing; a GPS that never had a fix is not what the estimator flies by."""
        if vehicle.fix_s is not None and self._without_s >= lost_s:
            return "the GPS has lost its fix" if vehicle.fix_s < vehicle.gps_s else "nothing is heard of the GPS"
        flags = vehicle.estimator_flags
        if flags is not None and (not flags & mavlink.EKF_POS_HORIZ_ABS or flags & mavlink.EKF_CONST_POS_MODE):
            return "the autopilot's estimator has no position"
        return ""
