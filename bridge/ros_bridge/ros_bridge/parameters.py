"""ROS 1's parameters as parameters of a ROS 2 node, ``/ros1_parameters``: ``/camera/rate`` is its ``camera.rate``.

The master's whole tree is asked for twice a second on a kept connection and looked at only when the answer is another; each change
goes through the node, so that ``/parameter_events`` tells it. They can't be set from ROS 2: their owner is the ROS 1 master.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ros_bridge.ros1_graph import MasterClient, MasterUnreachableError, value_of

import rclpy  # isort: skip
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult  # isort: skip
from rclpy.parameter import Parameter  # isort: skip

if TYPE_CHECKING:
    from rclpy.node import Node

logger = logging.getLogger("ros_bridge")

NODE_NAME = "ros1_parameters"
ASK_EVERY_S = 0.5
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
    """The node, to be spun by an executor, and the thread that asks the master."""

    def __init__(self, master_uri: str, caller_id: str) -> None:
        """Make the node; nothing is asked before ``start``."""
        self.node: Node = rclpy.create_node(NODE_NAME)
        self._client = MasterClient(master_uri, caller_id)
        self._answer = b""
        self._ours = threading.local()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ros1_parameters", daemon=True)
        self.node.add_on_set_parameters_callback(self._allow)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def _allow(self, _parameters: list[Parameter[Any]]) -> SetParametersResult:
        ours = bool(getattr(self._ours, "setting", False))
        return SetParametersResult(successful=ours, reason="" if ours else "these are ROS 1's parameters: set them there (rosparam set)")

    def _run(self) -> None:
        self._ours.setting = True
        while not self._stop.is_set():
            try:
                answer = self._client.ask_raw("getParam", "/")
                if answer != self._answer:
                    tree = value_of(answer)
                    self._show(dict(flatten(tree)) if isinstance(tree, Mapping) else {})
                    self._answer = answer
            except MasterUnreachableError:
                pass  # the last known values stay
            except Exception:  # one odd value must not end the mirror
                logger.exception("ROS 1's parameters can't be shown in ROS 2")
                self._answer = answer
            self._stop.wait(ASK_EVERY_S)

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
        """Stop asking."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
        self._client.close()
