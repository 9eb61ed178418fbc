"""Where the vehicle is and when it lifted off: by the simulator where there is one, else by the guidance. Pure."""

from __future__ import annotations

from radio_link.laws import Point

ON_GROUND = 1
"""``landed_state`` of uav_msgs/GuidanceState; 0 is unknown, every other is off the ground."""


class RadioCarrier:
    """The vehicle for the radio; ``point`` is in the frame map (ENU, metres), ``lift_off_s`` on the mission clock."""

    def __init__(self) -> None:
        self.point: Point | None = None
        self.lift_off_s: float | None = None
        self._simulated = False
        self._on_ground = False

    def simulated_at(self, point: Point) -> None:
        """Set the true place: from now on the guidance's is ignored."""
        self._simulated = True
        self.point = point

    def simulated_lift_off(self, lift_off_s: float | None) -> None:
        """Set the true time of lift-off; None: not yet."""
        self._simulated = True
        self.lift_off_s = lift_off_s

    def guided(self, point: Point, landed_state: int, now_s: float) -> None:
        """Set the guidance's estimate: on a real vehicle there is no better source."""
        if self._simulated:
            return
        self.point = point
        if landed_state == ON_GROUND:
            self._on_ground = True
        elif landed_state and self._on_ground and self.lift_off_s is None:
            self.lift_off_s = now_s
