"""The life of the bridge's process: checks, both nodes, the bridge, and its end."""

from __future__ import annotations

import logging
import os
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import rclpy
from rclpy.signals import SignalHandlerOptions

from alula.common.shared_memory import sweep_shared_memory
from ros_bridge.conversion import Types
from ros_bridge.definitions import DefinitionFiles, ament_prefixes, ros1_modules, ros1_shares
from ros_bridge.errors import NoMasterError
from ros_bridge.listing import list_routes
from ros_bridge.master import Connection, answers, wait_for_master
from ros_bridge.node import Bridge

if TYPE_CHECKING:
    from ros_bridge.config import BridgeConfig

logger = logging.getLogger("ros_bridge")

SWITCH_INTERVAL_S = 0.0005  # a thread that converts a message must not keep others waiting for Python's usual 5 ms
END_WITHIN_S = 1.5


def run_session(
    config: BridgeConfig,
    stats_file: Path | None,
    stop: threading.Event,
    master: Connection,
    name: str,
    ros2_arguments: list[str],
    *,
    wait: bool,
) -> None:
    """Start both nodes, bridge until asked to stop (or shut down by either world), end both nodes.

    ``name`` is that of the ROS 1 node, ``ros2_arguments`` are those of the ROS 2 node.

    Neither node takes time from ``/clock``: the bridge has to work before it ticks, and is what makes it tick in ROS 2.

    Raises:
        NoMasterError: There is no master, and ``wait`` does not say to wait for one.
    """
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    types = make_types(config)
    if not wait:
        require_master(master, name)
    if not wait_for_master(master, name, stop):
        return
    sweep_shared_memory()
    rclpy.init(args=ros2_arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        bridge = Bridge(config, types, master, name)
        bridge.run(stop, stats_file)
        _end_for_sure()
        bridge.close()
    finally:
        rclpy.try_shutdown()
    logger.info("ended")


def make_types(config: BridgeConfig) -> Types:
    """Return the types of both worlds, with the configuration's rules."""
    return Types(ament_prefixes(), config.rules, DefinitionFiles(ros1_shares(), ros1_modules()))


def require_master(master: Connection, name: str) -> None:
    """Check that the master answers; raises NoMasterError."""
    if not answers(master, name):
        raise NoMasterError(f"no ROS master answers at {master.uri}: start one (roscore), or set ROS_MASTER_URI to where it is")


def list_session(config: BridgeConfig, master: Connection, name: str) -> str:
    """Return the table of what would be bridged; raises NoMasterError."""
    require_master(master, name)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        return list_routes(config, make_types(config), master)
    except OSError as error:
        raise NoMasterError(f"the ROS master does not answer any more: {error}") from error
    finally:
        rclpy.try_shutdown()


def _end_for_sure() -> None:
    """End the process after ``END_WITHIN_S`` even if a master or peer that hangs holds up ``close``; the figures are written by now."""
    timer = threading.Timer(END_WITHIN_S, os._exit, (0,))
    timer.daemon = True
    timer.start()
