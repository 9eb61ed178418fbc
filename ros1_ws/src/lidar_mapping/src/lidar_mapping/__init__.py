"""A registered voxel map from the LiDAR's sweeps. The node is in ``lidar_mapping.node``."""

from lidar_mapping.mapper import Mapper, MapperSettings
from lidar_mapping.ply import read_ply, write_ply
from lidar_mapping.registration import Registration, RegistrationSettings, Surface, register
from lidar_mapping.settings import MappingSettings
from lidar_mapping.voxel_map import VoxelMap, downsample

__all__ = [
    "Mapper",
    "MapperSettings",
    "MappingSettings",
    "Registration",
    "RegistrationSettings",
    "Surface",
    "VoxelMap",
    "downsample",
    "read_ply",
    "register",
    "write_ply",
]
