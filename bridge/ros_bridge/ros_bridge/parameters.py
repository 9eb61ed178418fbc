"""ROS 1's parameters as parameters of a ROS 2 node, ``/ros1_parameters``: ``/camera/rate`` is its ``camera.rate``.

The master tells the node when a parameter changes; then its whole tree is read. Each change goes through the ROS 2 node, so that
``/parameter_events`` tells it. They can't be set from ROS 2: their owner is the ROS 1 master.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import rclpy
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.parameter import Parameter

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.master import Connection
    from ros_bridge.ros1_node import Ros1Node

logger = logging.getLogger("ros_bridge")

NODE_NAME = "ros1_parameters"
AGAIN_AFTER_S = 0.5
SETTLE_S = 0.02  # a file that is loaded changes many at once
SIM_TIME = "use_sim_time"  # every ROS 2 node has it from the start
Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]


def flatten(tree: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, Value]]:
    """Yield names and values as ROS 2 has them; what it has no kind for (mixed lists, nothing) becomes JSON text."""
    for key, value in tree.items():
        name = f"{prefix}{str(key).strip('/').replace('/', '.')}"
        if isinstance(value, Mapping):
            yield from flatten(value, f"{name}.")
        else:
            yield name, as_value(value)


def as_value(value: object) -> Value:
    """Return a value of one of ROS 2's kinds."""
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list):
        kinds = {type(item) for item in value}
        if kinds == {int, float}:
            return [float(item) for item in value]
        if not kinds or (len(kinds) == 1 and kinds <= {bool, int, float, str}):
            return list(value)
    return json.dumps(value, default=str)


class ParameterMirror:
    """The node, to be spun by an executor, and the thread that reads the parameters when they have changed."""

    def __init__(self, ros1_node: Ros1Node, master: Connection) -> None:
        """Make the node; nothing is asked before ``start``."""
        self.node: Node = rclpy.create_node(NODE_NAME)
        self._ros1_node = ros1_node
        self._master = master
        self._ours = threading.local()
        self._changed = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ros1_parameters", daemon=True)
        self.node.add_on_set_parameters_callback(self._allow)

    def start(self) -> None:
        """Subscribe to the parameters at the master, and start the thread that copies them."""
        self._ros1_node.subscribe_parameters(self._changed.set)
        self._thread.start()

    def _allow(self, _parameters: list[Parameter[Any]]) -> SetParametersResult:
        ours = bool(getattr(self._ours, "setting", False))
        return SetParametersResult(successful=ours, reason="" if ours else "these are ROS 1's parameters: set them there (rosparam set)")

    def _run(self) -> None:
        self._ours.setting = True
        while self._changed.wait() and not self._stop.wait(SETTLE_S):
            self._changed.clear()
            try:
                tree = self._master.call("getParam", self._ros1_node.name, "/")
                self._show(dict(flatten(tree)) if isinstance(tree, Mapping) else {})
            except OSError:  # the last known values stay
                self._stop.wait(AGAIN_AFTER_S)
                self._changed.set()
            except Exception:  # one odd value must not end the mirror
                logger.exception("ROS 1's parameters can't be shown in ROS 2")

    def _show(self, wanted: Mapping[str, Value]) -> None:
        shown = {
            name for name in self.node.get_parameters_by_prefix("") if name != SIM_TIME and not name.startswith("start_type_description")
        }
        for name in shown - wanted.keys():
            self.node.undeclare_parameter(name)
        for name, value in wanted.items():
            if self.node.has_parameter(name):
                if self.node.get_parameter(name).value != value:
                    self.node.set_parameters([Parameter(name, value=value)])
            else:
                self.node.declare_parameter(name, value, ParameterDescriptor(dynamic_typing=True, description="set in ROS 1"))

    def close(self) -> None:
        """Stop the thread; wait for it for a second at most."""
        self._stop.set()
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
