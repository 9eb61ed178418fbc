"""Where the sensors sit on the vehicle; frames: body FLU (x forward, y left, z up), cameras optical (z forward, x right)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_simulator.frames import Quat, Vec3

Floats = NDArray[np.float64]
STEREO_BASELINE_M = 0.12
GEAR_M = 0.05  # the landing gear gives way so far at most: no sensor touches the ground, where it would see nothing


@dataclass(frozen=True)
class Mount:
    """A sensor's frame in body: ``T_body_sensor`` as translation (m) and quaternion (w x y z)."""

    frame_id: str
    translation: Vec3
    rotation: Quat

    @property
    def matrix(self) -> Floats:
        """Return R_body_sensor as a rotation matrix, (3, 3) float64."""
        return rotation_matrix(self.rotation)


def rotation_matrix(q: Quat) -> Floats:
    """Return the (3, 3) matrix of a unit quaternion (w x y z)."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


OPTICAL: Quat = (0.5, -0.5, 0.5, -0.5)  # x right, y down, z forward
ACROSS: Quat = (0.5, 0.5, 0.5, 0.5)  # x left, y up, z (the spin axis) forward: the scan plane is across the direction of flight
ZED_LEFT = Mount("zed_left", (0.25, STEREO_BASELINE_M / 2, 0.0), OPTICAL)
ZED_RIGHT = Mount("zed_right", (0.25, -STEREO_BASELINE_M / 2, 0.0), OPTICAL)
CAMERA = Mount("camera", (0.3, 0.0, -0.05), OPTICAL)
LIDAR = Mount("lidar", (0.0, 0.0, -0.15), ACROSS)
IMU = Mount("imu", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
MOUNTS = (ZED_LEFT, ZED_RIGHT, CAMERA, LIDAR, IMU)
