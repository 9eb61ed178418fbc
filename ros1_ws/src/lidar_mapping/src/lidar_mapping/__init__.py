"""LiDAR-inertial SLAM: where the vehicle is, and a voxel map of what it has seen. The node is in ``lidar_mapping.node``."""

from lidar_mapping.inertial import ImuReading, InertialFilter, InertialNoise, InertialState
from lidar_mapping.keyframes import Keyframe, Keyframes
from lidar_mapping.odometry import AutopilotMotion, LidarInertialOdometry, OdometrySettings
from lidar_mapping.ply import read_ply, write_ply
from lidar_mapping.registration import Registration, RegistrationSettings, register
from lidar_mapping.settings import MappingSettings
from lidar_mapping.slam import Slam, SlamSettings
from lidar_mapping.surface import Patches, Surface, flat_patches
from lidar_mapping.voxel_map import VoxelMap, downsample

__all__ = [
    "AutopilotMotion",
    "ImuReading",
    "InertialFilter",
    "InertialNoise",
    "InertialState",
    "Keyframe",
    "Keyframes",
    "LidarInertialOdometry",
    "MappingSettings",
    "OdometrySettings",
    "Patches",
    "Registration",
    "RegistrationSettings",
    "Slam",
    "SlamSettings",
    "Surface",
    "VoxelMap",
    "downsample",
    "flat_patches",
    "read_ply",
    "register",
    "write_ply",
]
