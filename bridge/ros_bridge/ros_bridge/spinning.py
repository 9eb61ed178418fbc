"""Spin the executor of ROS 2 as long as the bridge lives, also after a callback has raised."""

from __future__ import annotations

import logging

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException, ShutdownException

logger = logging.getLogger("ros_bridge")


def spin(executor: Executor) -> None:
    """Spin until the executor or its context is shut down; what a callback raises is logged, and spinning goes on."""
    while True:
        try:
            executor.spin()
        except ExternalShutdownException:
            logger.info("ROS 2 was shut down")
        except ShutdownException:
            return
        except InvalidHandle:
            continue  # rclpy 7.1.6: an end was closed by another thread while the executor was about to look at it
        except Exception:
            logger.exception("a callback of ROS 2 raised")
            continue
        return
