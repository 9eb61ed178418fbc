"""The ROS 1 side of the nodes: the host of a core, settings, subscriptions to bytes, the worker."""

from perception_core.ros.host import RosHost
from perception_core.ros.settings import read_settings
from perception_core.ros.subscription import RawSubscriber, warn_of_garbage
from perception_core.ros.tuning import TunableSettings
from perception_core.ros.worker import NewestWorker

__all__ = [
    "NewestWorker",
    "RawSubscriber",
    "RosHost",
    "TunableSettings",
    "read_settings",
    "warn_of_garbage",
]
