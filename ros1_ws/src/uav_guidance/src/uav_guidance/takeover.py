"""Why the autopilot is in a mode that is not ours: the texts that came with the change of mode (STATUSTEXT, MAVLink common)."""

from __future__ import annotations

import math
from collections import deque

from uav_guidance.vehicle import VehicleSnapshot, mode_name

BEFORE_S, AFTER_S = 3.0, 2.0  # from a text to the mode that it explains, and from the mode to a text that comes late
LEAST_SEVERITY = 5  # NOTICE: a breached fence is told by one
MOST_TEXTS = 20
CHECKS = ("PreArm: ", "Arm: ")  # why it can't be armed: no reason for a mode


class Takeover:
    """The autopilot's texts around its last change of mode. Times are seconds of the mission clock."""

    def __init__(self) -> None:
        self._changed_s = -math.inf
        self._texts: deque[tuple[float, str]] = deque(maxlen=MOST_TEXTS)

    def hear_text(self, severity: int, text: str, now_s: float) -> None:
        """Record a whole text; infos, and what hinders arming, explain no mode."""
        if severity <= LEAST_SEVERITY and not text.startswith(CHECKS):
            self._texts.append((now_s, text))

    def mode_changed(self, now_s: float) -> None:
        """Record that a heartbeat has shown another mode."""
        self._changed_s = now_s

    def reason(self, vehicle: VehicleSnapshot) -> str:
        """Return who has the vehicle, in the autopilot's words where there are some."""
        texts = list(dict.fromkeys(text for heard_s, text in self._texts if -BEFORE_S <= heard_s - self._changed_s <= AFTER_S))
        mode = mode_name(vehicle.mode)
        if vehicle.off_ground and not vehicle.armed:
            who = "disarmed in the air: the autopilot has restarted, or its motors were stopped"
            return f"the vehicle is in {mode}, " + "; ".join([who, *texts])
        if texts:
            return f"the vehicle is in {mode}: {'; '.join(texts)}"
        return f"the vehicle is in {mode}: {'a failsafe' if vehicle.critical else 'the pilot or a failsafe'} has it"
