"""Where the vehicle is and when it lifted off: as the simulator says where there is one, else as the guidance has it. Pure."""

from __future__ import annotations

from radio_link.laws import Point

ON_GROUND = 1
"""``landed_state`` of uav_msgs/GuidanceState; 0 is unknown, every other is off the ground."""


class RadioCarrier:
    """What the radio knows of the vehicle; ``point`` is in the frame map (ENU, metres), ``lift_off_s`` on the mission clock."""

    def __init__(self) -> None:
        self.point: Point | None = None
        self.lift_off_s: float | None = None
        self._simulated = False
        self._on_ground = False

    def simulated_at(self, point: Point) -> None:
        """Take the true place: from now on the guidance is not believed."""
        self._simulated = True
        self.point = point

    def simulated_lift_off(self, lift_off_s: float | None) -> None:
        """Take the true time of lift-off; None: not yet."""
        self._simulated = True
        self.lift_off_s = lift_off_s

    def guided(self, point: Point, landed_state: int, now_s: float) -> None:
        """Take what the guidance believes: on a real vehicle there is no better source."""
        if self._simulated:
            return
        self.point = point
        if landed_state == ON_GROUND:
            self._on_ground = True
        elif landed_state and self._on_ground and self.lift_off_s is None:
            self.lift_off_s = now_s
