"""Hooks in a ROS 2 node: the managers of the model `mapping` with a function of ours. Run: `setup/in_ros2 python examples/r13_hooks.py`.

It prints:

    begins to map
    stops mapping
    INTERRUPTED, mapping_process is IDLE
"""

from __future__ import annotations

import threading

import rclpy
from mapping_interfaces import action
from mapping_managers.hooks import AbstractLidarMappingSkill
from mapping_managers.model import SKILLSET

from alula import Execution
from skillset_ros2 import NodeExecutor, SkillsetClient, SkillsetNode


class Mapping(AbstractLidarMappingSkill):
    """The generated class has a method a result of the model; this skill runs until it is interrupted."""

    def on_dispatch(self, _execution: Execution) -> None:
        """Start the function; return soon."""
        print("begins to map", flush=True)

    def on_interrupt(self, _execution: Execution) -> None:
        """Stop it; what the interruption does to resources is the managers' business."""
        print("stops mapping", flush=True)


rclpy.init()
managers = SkillsetNode(SKILLSET, action, lambda _node: {"lidar_mapping": Mapping()})
caller = rclpy.create_node("caller")
client = SkillsetClient(caller, "mapping")
executor = NodeExecutor()
for node in (managers, caller):
    executor.add_node(node)
spinning = threading.Thread(target=executor.spin)
spinning.start()
try:
    client.wait_ready(20.0)
    handle = client.start("lidar_mapping")
    handle.on_report(lambda report: handle.interrupt() if report.state.name == "RUNNING" else None)
    handle.wait(20.0)
    print(f"{handle.outcome}, mapping_process is {client.resources['mapping_process']}")
finally:
    executor.shutdown()
    spinning.join()
    rclpy.try_shutdown()
