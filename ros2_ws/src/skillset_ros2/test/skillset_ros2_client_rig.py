"""Managers of the drone's navigation in this process, brought into any state, for the tests of their clients."""

from __future__ import annotations

import itertools
import threading

import navigation_interfaces.action
from navigation_managers.model import SKILLSET
from rclpy.executors import SingleThreadedExecutor

from alula_testing import waits
from alula_testing.recorder import Recorder
from alula_testing.ros2 import end_spinning, spin
from skillset_ros2 import SkillsetNode

SOON_S = 10.0
READY_S = 30.0
NUMBERS = itertools.count()
READY_TO_TAKE_OFF = {"SDK_authority": "AVAILABLE", "homepoint_status": "VALID"}


def until(condition, what: str, timeout_s: float = SOON_S) -> None:
    waits.until(condition, what, timeout_s)


class Spun:
    """A node that a thread spins."""

    def __init__(self, node, executor=None) -> None:
        self.node = node
        self.executor = executor or SingleThreadedExecutor()
        self.executor.add_node(node)
        self._thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        end_spinning(self.executor, self._thread)
        self.node.destroy_node()


class Managers:
    """The managers; ``ready`` takes the extern transitions that a takeoff needs."""

    def __init__(self, *, ready: bool = True, **node_options: object) -> None:
        self.hooks = {skill.name: Recorder() for skill in SKILLSET.skills}
        self.node = SkillsetNode(SKILLSET, navigation_interfaces.action, lambda _: self.hooks, **node_options)
        self.engine = self.node.engine
        self._spun = Spun(self.node)
        if ready:
            self.bring(READY_TO_TAKE_OFF)

    def bring(self, states: dict[str, str]) -> None:
        for resource, state in states.items():
            assert self.engine.transition(resource, state).accepted

    def reset(self) -> None:
        """Be as after the start: nothing runs, ready to take off."""
        self.engine.fail_all("the next test")
        for hooks in self.hooks.values():
            hooks.dispatched.clear()
        initial = {resource.name: resource.initial for resource in SKILLSET.resources} | READY_TO_TAKE_OFF
        states = {name: status.state for name, status in self.engine.resources.items()}
        self.bring({name: state for name, state in initial.items() if states[name] != state})

    def running(self):
        """Return the one execution as soon as its function was started."""
        until(lambda: self.engine.executions and self.engine.executions[0].state.value == "RUNNING", "it runs")
        execution = self.engine.executions[0]
        assert self.hooks[execution.skill].dispatched.wait(SOON_S)
        return execution

    def close(self) -> None:
        self.node.close("the test is over")
        self._spun.close()
