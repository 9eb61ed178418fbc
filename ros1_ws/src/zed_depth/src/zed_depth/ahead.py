"""From a depth image to the nearest obstacle ahead: the ZED's depth skill as one function."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception_core import Ahead, Corridor, PoseBuffer, Support, VehicleMotion, direction_of_motion
from perception_core.nearest import nearest_obstacle
from zed_depth.calibration import StereoGeometry
from zed_depth.stereo import points_of

Floats = NDArray[np.float64]
VIEW_M = 3.0  # how far ahead the corridor's cross-section must be in view: farther than the vehicle needs to stop
VIEW_SHARE = 0.5  # of the cross-section
GRID = (9, 5)
PARTS = 8  # side by side, of the corridor's view: each must have depths, or what covers a lens would pass for a free way
UPWARDS = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ZedAheadSettings:
    """Where to look, and how much evidence to require.

    The range ends where a disparity error of one pixel makes the depth useless: with fx 240 px and 0.12 m between the cameras one pixel is
    0.6 m at 4 m, 2.2 m at 8 m. With a depth for less than ``min_known`` of an eighth of the corridor's width it is unknown what is there.
    """

    corridor: Corridor
    support: Support
    max_range_m: float = 8.0
    stride_px: int = 2
    min_known: float = 0.05


def look_ahead(
    depth_m: NDArray[np.float32],
    stamp_ns: int,
    *,
    geometry: StereoGeometry,
    T_base_camera: Floats,  # noqa: N803 -- T_target_source
    poses: PoseBuffer,
    motion: VehicleMotion,
    settings: ZedAheadSettings,
) -> Ahead:
    """Return what is in the corridor, in the map; raise PoseUnavailableError."""
    pose = poses.at([stamp_ns]).matrix()
    T_map_camera = pose @ T_base_camera  # noqa: N806 -- T_target_source
    direction = direction_of_motion(pose[:3, 3], pose[:3, 0], motion)
    stride_px = settings.stride_px
    depths = np.ascontiguousarray(depth_m[::stride_px, ::stride_px])
    wanted = depths <= settings.max_range_m
    # Most of what is seen is beside the corridor: it is left out before points are made of it.
    sides = ((np.array([-direction[1], direction[0], 0.0]), settings.corridor.half_width_m), (UPWARDS, settings.corridor.half_height_m))
    for axis, half_m in sides:
        offset_m = float(axis @ (T_map_camera[:3, 3] - pose[:3, 3]))
        wanted &= np.abs(_along(axis @ T_map_camera[:3, :3], depths, geometry, stride_px) + np.float32(offset_m)) <= half_m
    points, areas = points_of(depth_m, geometry, wanted, stride_px=stride_px)
    in_map = points @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    nearest = nearest_obstacle(in_map, pose[:3, 3], direction, settings.corridor, settings.support, areas)
    T_camera_map = np.asarray(np.linalg.inv(T_map_camera), dtype=np.float64)  # noqa: N806 -- T_target_source
    return Ahead(nearest, _unknown(depth_m, geometry, T_camera_map, pose[:3, 3], direction, settings))


def _along(axis: Floats, depths_m: NDArray[np.float32], geometry: StereoGeometry, stride_px: int) -> NDArray[np.float32]:
    """Return how far what the pixels show is along an axis (3,) of the camera's frame, (h, w) metres."""
    rows, columns = (stride_px * np.arange(length, dtype=np.float32) for length in depths_m.shape)
    by_column = ((columns - geometry.cx) * (axis[0] / geometry.fx) + axis[2]).astype(np.float32)
    by_row = ((rows - geometry.cy) * (axis[1] / geometry.fy)).astype(np.float32)
    with np.errstate(invalid="ignore"):  # of infinite depths
        along: NDArray[np.float32] = depths_m * (by_column[None, :] + by_row[:, None])
    return along


def _unknown(
    depth_m: NDArray[np.float32],
    geometry: StereoGeometry,
    T_camera_map: Floats,  # noqa: N803 -- T_target_source
    origin: Floats,
    direction: Floats,
    settings: ZedAheadSettings,
) -> str:
    """Return why an obstacle may be in the corridor that is not seen, or an empty text."""
    corridor = settings.corridor
    across, up = np.meshgrid(
        np.linspace(-corridor.half_width_m, corridor.half_width_m, GRID[0]),
        np.linspace(-corridor.half_height_m, corridor.half_height_m, GRID[1]),
    )
    left = np.array([-direction[1], direction[0], 0.0])
    section = origin + VIEW_M * direction + across.reshape(-1, 1) * left + up.reshape(-1, 1) * UPWARDS
    x, y, z = (section @ T_camera_map[:3, :3].T + T_camera_map[:3, 3]).T
    height, width = depth_m.shape
    ahead = np.maximum(z, 1e-6)
    columns, rows = geometry.fx * x / ahead + geometry.cx, geometry.fy * y / ahead + geometry.cy
    visible = (z > 0.1) & (columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1)
    if np.mean(visible) < VIEW_SHARE:
        return "the camera does not look where the vehicle goes"
    low_row, low_column = int(rows[visible].min()), int(columns[visible].min())
    window = depth_m[low_row : int(rows[visible].max()) + 1, low_column : int(columns[visible].max()) + 1]
    parts = [part for part in np.array_split(np.isfinite(window), PARTS, axis=1) if part.size]
    known = min(float(np.mean(part)) for part in parts)
    return "" if known >= settings.min_known else f"only {known:.0%} of a part of the view ahead has a depth"
