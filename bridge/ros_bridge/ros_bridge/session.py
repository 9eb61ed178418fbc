"""Both nodes from their beginning to their end."""

from __future__ import annotations

import logging
import os
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from ros_bridge import two_worlds
from ros_bridge.conversion import Types
from ros_bridge.definitions import DefinitionFiles, ament_prefixes, ros1_shares
from ros_bridge.master import Master

two_worlds.import_ros1()

import rclpy  # noqa: E402 - ROS 1 goes first
import rospy  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402

from ros_bridge.node import Bridge  # noqa: E402

if TYPE_CHECKING:
    from ros_bridge.config import BridgeConfig

logger = logging.getLogger("ros_bridge")

NODE_NAME = "ros_bridge"
SWITCH_INTERVAL_S = 0.0005  # a thread that copies an image must not keep /clock waiting for Python's usual 5 ms
END_WITHIN_S = 1.5


def run_session(config: BridgeConfig, stats_file: Path | None, stop: threading.Event, master_uri: str) -> None:
    """Wait for the master, start both nodes, bridge until asked to stop (or shut down by either world), end both nodes.

    Neither node takes time from ``/clock``: the bridge has to work before it ticks, and is what makes it tick in ROS 2.
    """
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    types = Types(ament_prefixes(), config.rules, DefinitionFiles(ros1_shares(), two_worlds.find_ros1_path()))
    master = Master(master_uri, f"/{NODE_NAME}")
    if not master.wait(stop):
        return
    rospy.init_node(NODE_NAME, argv=sys.argv, disable_signals=True, disable_rostime=True)
    rospy.on_shutdown(stop.set)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        bridge = Bridge(config, types, master)
        bridge.run(stop, stats_file)
        _end_for_sure()
        bridge.close()
    finally:
        rospy.signal_shutdown("the bridge ends")
        rclpy.try_shutdown()
    logger.info("ended")


def _end_for_sure() -> None:
    """End the process in any case: a master or peer that hangs may hold up the farewell, and the figures are written by now."""
    timer = threading.Timer(END_WITHIN_S, os._exit, (0,))
    timer.daemon = True
    timer.start()
