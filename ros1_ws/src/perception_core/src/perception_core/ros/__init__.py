"""The ROS 1 side that the perception nodes share: conversions, settings, the vehicle's inputs, health reports, the worker."""

from perception_core.ros.conversions import (
    cloud_message,
    depth_message,
    image_to_array,
    matrix_of_transform,
    obstacle_message,
    sweep_of_cloud,
)
from perception_core.ros.done import DoneReporter
from perception_core.ros.health import HealthReporter
from perception_core.ros.settings import SettingsError, read_settings
from perception_core.ros.switch import EnableSwitch
from perception_core.ros.vehicle import Vehicle
from perception_core.ros.worker import NewestWorker

__all__ = [
    "DoneReporter",
    "EnableSwitch",
    "HealthReporter",
    "NewestWorker",
    "SettingsError",
    "Vehicle",
    "cloud_message",
    "depth_message",
    "image_to_array",
    "matrix_of_transform",
    "obstacle_message",
    "read_settings",
    "sweep_of_cloud",
]
