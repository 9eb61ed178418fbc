"""A core on a ROS 1 graph: its host, subscriptions to bytes, the worker."""

from node_core.ros.host import RosHost
from node_core.ros.subscription import RawSubscriber, warn_of_garbage
from node_core.ros.worker import NewestWorker

__all__ = ["NewestWorker", "RawSubscriber", "RosHost", "warn_of_garbage"]
