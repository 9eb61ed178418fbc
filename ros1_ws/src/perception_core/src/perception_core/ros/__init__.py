"""The ROS 1 side that the perception nodes share: conversions, settings, the vehicle's inputs, health reports, the worker."""

from perception_core.clouds import sweep_of_cloud
from perception_core.ros.conversions import (
    cloud_message,
    depth_message,
    matrix_of_transform,
    obstacle_message,
)
from perception_core.ros.done import DoneReporter
from perception_core.ros.health import HealthReporter
from perception_core.ros.settings import read_settings
from perception_core.ros.subscription import RawSubscriber, warn_of_garbage
from perception_core.ros.switch import EnableSwitch
from perception_core.ros.tuning import TunableSettings
from perception_core.ros.vehicle import Vehicle
from perception_core.ros.worker import NewestWorker

__all__ = [
    "DoneReporter",
    "EnableSwitch",
    "HealthReporter",
    "NewestWorker",
    "RawSubscriber",
    "TunableSettings",
    "Vehicle",
    "cloud_message",
    "depth_message",
    "matrix_of_transform",
    "obstacle_message",
    "read_settings",
    "sweep_of_cloud",
    "warn_of_garbage",
]
