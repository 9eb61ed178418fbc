"""The skillsets served in this process, over the faked functional layer, with a client each."""

from __future__ import annotations

import importlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from uav_skills_functional_fake import LONG_WAY_STEP_M, STEP_S, WALL_STEP_S, FakeFunctional

from alula_testing.ros2 import end_spinning, spin

SKILLSETS = ("navigation", "perception", "mapping", "video")
READY = {
    ("navigation", "SDK_authority"): "AVAILABLE",
    ("navigation", "homepoint_status"): "VALID",
    ("navigation", "flight_status"): "ON_GROUND",
    ("navigation", "link"): "UP",
    ("perception", "zed_status"): "OK",
    ("perception", "lidar_status"): "OK",
    ("video", "link"): "UP",
}
STANDS_STILL_S = 30.0
"""So long, in seconds of wall clock, the mission clock may stand still: a node that is there hears of it sooner."""


class Rig:
    """Functional layer, managers, clients."""

    def __init__(self) -> None:
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.parameter import Parameter

        from skillset_ros2 import SkillsetClient, SkillsetNode

        self._ready = False
        self.nodes = []
        self.followers: list[Callable[[], float]] = []
        """Further clocks that time waits for, in seconds: of processes beside this one."""
        self.functional = FakeFunctional(heard_s=self._heard_s)
        self.executor = SingleThreadedExecutor()
        sim_time = [Parameter("use_sim_time", value=True)]
        self._hooks: list[object] = []
        for name in SKILLSETS:
            model = importlib.import_module(f"{name}_managers.model")
            interfaces = importlib.import_module(f"{name}_interfaces.action")
            make_hooks = self._kept(importlib.import_module(f"uav_skills.{name}").make_hooks)
            self.nodes.append(
                SkillsetNode(model.SKILLSET, interfaces, make_hooks, data_bindings=model.DATA_TOPICS, parameter_overrides=sim_time)
            )
        self.caller = Node("uav_skills_test_caller", parameter_overrides=sim_time)
        self.nodes.append(self.caller)
        for node in self.nodes:
            self.executor.add_node(node)
        self.clients = {name: SkillsetClient(self.caller, name) for name in SKILLSETS}
        self._thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self._thread.start()
        assert all(client.wait_ready(20.0) for client in self.clients.values())
        self._ready = True

    def _heard_s(self) -> float:
        """Return the clock of the slowest node that serves, or of a follower; it is 0.0 until that has heard it."""
        if not self._ready:
            return math.inf
        heard_s = [node.get_clock().now().nanoseconds * 1e-9 for node in self.nodes]
        return min([*heard_s, *(follower() for follower in self.followers)])

    def _kept(self, make_hooks):
        from skillset_ros2 import SlowerClock

        def make(node):
            hooks = make_hooks(node)
            self._hooks += hooks.values()
            for api in self._apis(hooks.values()):  # their monotonic clock runs as fast as the functional layer's
                api._slower = SlowerClock(lambda api=api: api.now_s, lambda: time.monotonic() * STEP_S / WALL_STEP_S)
            return hooks

        return make

    def _apis(self, hooks):
        return [api for hook in hooks for api in vars(hook).values() if hasattr(api, "_calls")]

    def _calls_are_answered(self) -> bool:
        """Return whether no call of a test before is still on its way: it would look like one of the next test's."""
        apis = self._apis(self._hooks)
        assert apis, "the hooks have no functional interface any more: look here"
        return not any(api._calls._calls for api in apis)

    def prepare(self) -> None:
        self.wait(self._calls_are_answered)
        self.functional.reset()
        for (skillset, resource), state in READY.items():
            self.set(skillset, resource, state)

    def set(self, skillset: str, resource: str, state: str) -> None:
        if self.clients[skillset].resources[resource] != state:
            self.functional.report(skillset, resource, state)
        self.wait(lambda: self.clients[skillset].resources[resource] == state)

    def start(self, skillset: str, skill: str, **inputs):
        return self.clients[skillset].start(skill, **inputs)

    def in_air(self) -> None:
        self.functional.fly_at(0.0, 0.0, 3.0)
        self.set("navigation", "flight_status", "IN_AIR")

    def start_long_flight(self, skill: str):
        """Start a flight that takes two minutes of wall clock: on a machine however busy, it is still under way when something happens."""
        self.in_air()
        self.functional.vehicle.step_m = LONG_WAY_STEP_M
        return self.start("navigation", skill, target=(50.0, 0.0, 3.0), speed=1.0)

    @contextmanager
    def clock_held(self) -> Iterator[None]:
        """Let the mission clock stand still, within ``AHEAD_S``: for what takes wall clock, and is asked of one moment."""
        held_s = self.functional.now_s
        follower = lambda: held_s  # noqa: E731
        self.followers.append(follower)
        try:
            yield
        finally:
            self.followers.remove(follower)

    def wait(self, condition, timeout_s: float = 60.0) -> None:
        """Wait for ``timeout_s`` of mission clock: a busy machine makes it longer. A clock that stands still ends it, too.

        The time that the condition itself takes does not count: it may hold the clock.
        """
        end_s = self.functional.now_s + timeout_s
        seen_s, stood_s = self.functional.now_s, 0.0
        while not condition():
            began = time.monotonic()
            time.sleep(0.005)
            now_s = self.functional.now_s
            assert now_s < end_s, f"it did not come in {timeout_s:g} s of mission clock"
            stood_s = 0.0 if now_s != seen_s else stood_s + time.monotonic() - began
            seen_s = now_s
            assert stood_s < STANDS_STILL_S, f"the mission clock stands still at {now_s:g} s"

    def ended(self, handle) -> tuple[str, str]:
        self.wait(lambda: handle.done)
        return handle.outcome, handle.result

    def close(self) -> None:
        for node in self.nodes[:-1]:
            node.close("test is over")
        end_spinning(self.executor, self._thread)
        for node in self.nodes:
            node.destroy_node()
        self.functional.close()
