"""Data, durations, deadlines and events on a live ROS 2 graph: what no request causes happens when it is due."""

from __future__ import annotations

import itertools
import threading
import time
from dataclasses import replace

import pytest

rclpy = pytest.importorskip("rclpy")
mapping_actions = pytest.importorskip("mapping_interfaces.action")

from mapping_managers.model import SKILLSET  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from skillset_interfaces.msg import Event as EventMessage  # noqa: E402
from skillset_interfaces.srv import TriggerEvent  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.model.expressions import Comparison, DataIs, ResourceIs  # noqa: E402
from alula.model.model import Assignment, Data, Effect, Event, Hold, Invariant, Progress  # noqa: E402
from alula_testing import waits  # noqa: E402
from alula_testing.recorder import Recorder  # noqa: E402
from alula_testing.ros2 import end_spinning, spin  # noqa: E402
from skillset_ros2 import SkillsetNode  # noqa: E402
from skillset_ros2.names import EVENTS  # noqa: E402

S = ExecutionState
SOON_S = 20.0
NUMBERS = itertools.count()
FAST = DataIs("fps", (), Comparison.GE, 10.0)
SKILL = SKILLSET.skills[0]
FINISH = Effect("finish", (Assignment("mapping_process", "IDLE"),))
IDLE = ResourceIs("mapping_process", "IDLE")


def until(condition, what: str) -> None:
    waits.until(condition, what, SOON_S)


class Managers:
    """The mapping skillset, watched by an invariant over ``fps`` or a deadline, and the camera that publishes it."""

    def __init__(self, *, hold: Hold | None = None, deadline_s: float | None = None, events=(), period_s=0.1, simulated=False) -> None:
        invariants = () if deadline_s else (Invariant("fast", FAST, FINISH, hold),)
        skill = replace(SKILL, invariants=invariants, progress=Progress(0.05, deadline_s=deadline_s))
        model = replace(SKILLSET, skills=(skill, *SKILLSET.skills[1:]), data=(Data("fps", "float64", period_s),), events=events)
        number = next(NUMBERS)
        self.hooks = {skill.name: Recorder() for skill in model.skills}
        place = {"namespace": f"timed_{number}"}
        bindings = {"fps": ("/camera/fps", "std_msgs/msg/Float64")}
        clock = {"parameter_overrides": [Parameter("use_sim_time", value=True)]} if simulated else {}
        self.node = SkillsetNode(model, mapping_actions, lambda _: self.hooks, data_bindings=bindings, **place, **clock)
        self.other = Node("tester", **place)
        self.camera = self.other.create_publisher(Float64, "camera/fps", 10)
        self.trigger = self.other.create_client(TriggerEvent, "mapping/trigger")
        self.heard: list = []
        self.other.create_subscription(EventMessage, "mapping/events", self.heard.append, EVENTS)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.other)
        self.thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self.thread.start()

    def film(self, fps: float) -> None:
        """Publish one value to the managers."""
        until(lambda: self.camera.get_subscription_count() > 0, "the managers listen")
        self.camera.publish(Float64(data=fps))

    def run(self):
        return self.node.engine.request(SKILL.name, {})

    def close(self) -> None:
        self.node.close("the test is over")
        end_spinning(self.executor, self.thread)
        self.node.destroy_node()
        self.other.destroy_node()


@pytest.fixture
def managers(ros2_domain):
    made: list[Managers] = []

    def make(**options: object) -> Managers:
        made.append(Managers(**options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_camera_that_dies_ends_what_needs_it(managers):
    mapping = managers(hold=Hold(0.3))
    execution = mapping.run()
    mapping.film(30.0)
    until(lambda: execution.done, "the value gets stale, and 0.3 s pass")
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "fast")
    assert execution.message == "fast: fps has no fresh value for 0.3 s"
    until(lambda: "on_violation" in mapping.hooks[SKILL.name].calls, "the function is stopped")


def test_a_slow_camera_ends_it_with_the_value(managers):
    mapping = managers(period_s=60.0)
    runs: list = []
    until(lambda: mapping.film(30.0) or runs.append(mapping.run()) or runs[-1].state is S.RUNNING, "a fresh value lets it run")
    mapping.film(3.0)
    until(lambda: runs[-1].done, "the value breaks it")
    assert (runs[-1].result, runs[-1].message) == ("fast", "fast: fps is 3.0")


def test_an_execution_that_stands_still_fails_at_its_deadline(managers):
    mapping = managers(deadline_s=0.4)
    began = time.monotonic()
    execution = mapping.run()
    until(lambda: execution.done, "the deadline passes")
    assert time.monotonic() - began >= 0.4
    assert (execution.state, execution.message) == (S.FAILED, "no progress for 0.4 s")


def test_deadlines_are_of_the_simulated_clock(managers):
    mapping = managers(deadline_s=5.0, simulated=True)
    clock = mapping.other.create_publisher(Clock, "/clock", 10)

    def at(seconds: float) -> None:
        stamp = Time(seconds=seconds)
        until(
            lambda: clock.publish(Clock(clock=stamp.to_msg())) or mapping.node.get_clock().now().nanoseconds == stamp.nanoseconds,
            "the clock is heard",
        )

    at(100.0)
    execution = mapping.run()
    assert mapping.node.engine.due_ns == 105_000_000_000
    at(104.75)
    assert execution.state is S.RUNNING
    at(105.0)
    until(lambda: execution.done, "the deadline passes")
    assert execution.message == "no progress for 5 s"


def test_an_event_is_triggered_over_ros(managers):
    begin = Event("begin", IDLE, Effect("", (Assignment("mapping_process", "RUNNING"),)))
    mapping = managers(hold=Hold(60.0), events=(begin,))
    assert mapping.trigger.wait_for_service(SOON_S)
    answers: list = []
    until(
        lambda: answers.append(mapping.trigger.call(TriggerEvent.Request(event="begin"), timeout_sec=1.0)) or answers[-1] is not None,
        "the service answers",
    )
    assert mapping.node.engine.resources["mapping_process"].state == "RUNNING"
    until(lambda: [e for e in mapping.heard if e.kind == EventMessage.TRANSITION], "the transition is heard")
    (heard,) = [e for e in mapping.heard if e.kind == EventMessage.TRANSITION]
    assert (heard.resource, heard.from_state, heard.to_state, heard.cause) == ("mapping_process", "IDLE", "RUNNING", "event begin")
    refused = mapping.trigger.call(TriggerEvent.Request(event="begin"), timeout_sec=SOON_S)
    assert (refused.accepted, refused.reason) == (False, "event begin: its guard is false: mapping_process is RUNNING")
