"""Which of the links to people on the ground are lost [10], whether the vehicle is beyond its fence [19], or without a position [18]."""

from __future__ import annotations

import math

from uav_simulator.autopilot.params import Parameters
from uav_simulator.frames import Vec3

POSITION_LOST_S = 0.8  # without a position, ten checks in a row


class Failsafes:
    """Remembers the remote control's and the ground station's state; the autopilot decides the response to a loss."""

    def __init__(self, params: Parameters) -> None:
        self._params = params
        self._gcs_heard_s: float | None = None
        self.rc_lost = False
        self.gcs_lost = False
        self._beyond = False
        self._unlocated_s = 0.0

    @property
    def active(self) -> bool:
        """Return whether a cause lasts."""
        return self.rc_lost or self.gcs_lost or self.position_lost

    @property
    def position_lost(self) -> bool:
        """Return whether the estimator has been without a position for too long."""
        return self._unlocated_s >= POSITION_LOST_S

    def hear_gcs(self, now_s: float) -> bool:
        """Record a heartbeat of the ground station; return whether that ends its failsafe."""
        self._gcs_heard_s = now_s
        was_lost, self.gcs_lost = self.gcs_lost, False
        return was_lost

    def set_rc(self, *, lost: bool) -> bool:
        """Record the remote control's state; return whether that begins its failsafe."""
        begins = lost and not self.rc_lost and bool(self._params["FS_THR_ENABLE"])
        self.rc_lost = lost
        return begins

    def gcs_falls_silent(self, now_s: float) -> bool:
        """Return whether the ground station's failsafe begins now: it is enabled, had sent heartbeats, and has been silent for too long."""
        heard = self._gcs_heard_s
        if not self._params["FS_GCS_ENABLE"] or heard is None or self.gcs_lost:
            return False
        self.gcs_lost = now_s - heard > self._params["FS_GCS_TIMEOUT"]
        return self.gcs_lost

    def position_fails(self, dt_s: float, *, located: bool) -> bool:
        """Return whether the estimator's failsafe begins now, of a vehicle that flies."""
        was_lost = self.position_lost
        self._unlocated_s = 0.0 if located else self._unlocated_s + dt_s
        return self.position_lost and not was_lost

    def fence_breaks(self, position: Vec3, home: Vec3 | None) -> bool:
        """Return whether the fence is breached now; once, until the vehicle is inside again."""
        was_beyond = self._beyond
        p = self._params
        self._beyond = (
            bool(p["FENCE_ENABLE"])
            and home is not None
            and (math.dist(position[:2], home[:2]) > p["FENCE_RADIUS"] or position[2] - home[2] > p["FENCE_ALT_MAX"])
        )
        return self._beyond and not was_beyond
