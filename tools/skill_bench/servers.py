"""The serving sides, each in a process of its own: a skillset's managers, and the bare rclpy that they are compared with."""

from __future__ import annotations

import sys
import threading
import time
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Any

import rclpy
from navigation_interfaces.action import Hover
from rclpy.action import ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from skillset_interfaces.msg import Event

from alula.model.model import Skillset
from alula.model.ros_types import camel
from alula.runtime.hooks import SkillHooks
from skill_bench.cases import Case, make_skillset
from skill_bench.processes import follow
from skillset_ros2 import SkillsetNode
from skillset_ros2.names import EVENTS
from skillset_ros2.session import Session
from skillset_ros2.spin import spin_until

ACTION = Hover
"""One built action, with one number for its goal, serves for all skills."""
BARE_ACTION, BARE_TOPIC = "bench_bare/hover", "bench_bare/events"
PACE_S = 0.02
"""Between the messages of a topic, so that none waits for another."""
DISCOVERED_S = 30.0


def make_interfaces(skillset: Skillset) -> ModuleType:
    """Return a module with an action for every skill, importable as the generated one would be."""
    package, module = ModuleType(f"{skillset.name}_interfaces"), ModuleType(f"{skillset.name}_interfaces.action")
    for skill in skillset.skills:
        setattr(module, camel(skill.name), ACTION)
    sys.modules |= {package.__name__: package, module.__name__: module}
    return module


def serve_managers(connection: Connection, case: Case) -> None:
    """Be the managers of a case, as ``run_skillset`` serves them, with hooks that do nothing."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    skillset = make_skillset(case)
    node = SkillsetNode(skillset, make_interfaces(skillset), lambda _: {skill.name: SkillHooks() for skill in skillset.skills})
    stop = threading.Event()

    def orders() -> None:
        follow(connection, {"ready": lambda: None})
        stop.set()

    threading.Thread(target=orders, daemon=True).start()
    spin_until(node, stop)
    node.destroy_node()
    rclpy.try_shutdown()


def serve_bare(connection: Connection, _: object) -> None:
    """Be a bare action, whose goals succeed at once, and a bare topic of the type and qualities of the skillsets' events."""
    session = Session("bench_bare_server", executor=SingleThreadedExecutor)
    server = ActionServer(session.node, ACTION, BARE_ACTION, execute_callback=_succeed)
    topic = session.node.create_publisher(Event, BARE_TOPIC, EVENTS)

    def publish(number: int) -> None:
        for _ in range(number):
            message = Event(kind=Event.EXECUTION, skillset="bench", skill="hover", state="RUNNING")
            message.header.stamp = Time(nanoseconds=session.node.get_clock().now().nanoseconds).to_msg()
            topic.publish(message)
            time.sleep(PACE_S)

    def ready() -> None:
        end_s = time.monotonic() + DISCOVERED_S
        while not topic.get_subscription_count():
            if time.monotonic() > end_s:
                raise TimeoutError(f"no subscriber of {BARE_TOPIC} within {DISCOVERED_S:g} s")
            time.sleep(PACE_S)

    follow(connection, {"ready": ready, "publish": publish})
    server.destroy()
    session.close()


def _succeed(goal: Any) -> Any:
    goal.succeed()
    return ACTION.Result()
