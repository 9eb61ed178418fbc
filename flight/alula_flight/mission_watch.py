"""Whether the mission is heard: a process that lives and does nothing is noticed by nobody else."""

from __future__ import annotations

from typing import Any

from alula_flight.mission_clock import MissionClock

HEARTBEAT = "mission/heartbeat"
SILENT_S = 30.0
"""Mission clock. Simulated time waits for heartbeats, and a bridge that has died is started again sooner."""


class MissionWatch:
    """Follows the heartbeats of a mission from the first one on: each tick sends one, also while it is paused or stops the robot."""

    def __init__(self, clock: MissionClock) -> None:
        self._clock = clock
        self._heard_s: float | None = None

    def listen(self) -> None:
        """Follow the topic; rospy's node must be there."""
        import rospy

        rospy.Subscriber(HEARTBEAT, rospy.AnyMsg, self.hear, queue_size=1)

    def hear(self, _heartbeat: Any = None) -> None:
        """Take note of a heartbeat."""
        self._heard_s = self._clock.now_s

    @property
    def silent(self) -> bool:
        """Return whether the mission has been heard, and has not for so long that it decides nothing any more."""
        now_s = self._clock.now_s
        return self._heard_s is not None and now_s is not None and now_s - self._heard_s > SILENT_S
