"""Managers and client on a live ROS 2 graph, with the drone's generated navigation and fake hooks."""

from __future__ import annotations

import itertools
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from action_msgs.msg import GoalStatus, GoalStatusArray  # noqa: E402
from geometry_msgs.msg import Point  # noqa: E402
from navigation_managers.inputs import GotoStraightInputs  # noqa: E402
from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import qos_profile_action_status_default  # noqa: E402
from skillset_interfaces.srv import Describe, GetData  # noqa: E402
from skillset_ros2_rig import (  # noqa: E402
    NUMBERS,
    READY_S,
    SOON_S,
    Navigation,
    take,
    until,
)
from uav_msgs.msg import GuidanceState  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.model.json_form import from_json  # noqa: E402
from alula.runtime.core.errors import SkillRuntimeError  # noqa: E402
from alula_testing.navigation import FLYING, check_interrupt_and_violation, check_refusals  # noqa: E402
from alula_testing.recorder import Recorder  # noqa: E402
from skillset_ros2 import ActionClient, SkillsetClient, SkillsetNode  # noqa: E402
from skillset_ros2.names import EVENTS  # noqa: E402
from skillset_ros2.spin import spin_until  # noqa: E402

S = ExecutionState


def test_an_execution_from_request_to_result(navigation):
    navigation.bring(FLYING)
    seen = []
    navigation.client.on_change(seen.append)
    handle = navigation.fly()
    execution = navigation.managers.engine.executions[0]
    assert execution.id == handle.id
    assert execution.inputs == GotoStraightInputs(target=Point(x=1.0, y=2.5, z=3.0), speed=1.0)
    until(lambda: handle.progress == 0.5, "progress is reported every period")
    ended = threading.Event()
    handle.add_done_callback(lambda _: ended.set())
    execution.terminate("ARRIVED", "there")
    assert handle.wait(SOON_S)
    assert ended.wait(SOON_S)
    assert (handle.state, handle.outcome, handle.result, handle.message) == (S.TERMINATED, "TERMINATED", "ARRIVED", "there")
    until(lambda: [states["axes_authority"] for states in seen] == ["USED", "AVAILABLE"], "the resource followed")
    until(lambda: navigation.events and navigation.events[-1].state == "TERMINATED", "all events")
    assert [event.sequence for event in navigation.events] == list(range(1, len(navigation.events) + 1))
    held = ["axes_authority", "heading_authority"]
    told = [event.resource or event.state for event in navigation.events[len(FLYING) :]]
    assert told == ["REQUESTED", *held, "RUNNING", *held, "TERMINATED"]
    first = next(event for event in navigation.events if event.state == "REQUESTED")
    assert json.loads(first.inputs_json) == {"target": {"x": 1.0, "y": 2.5, "z": 3.0}, "speed": 1.0}


def test_refusals_carry_their_reason(navigation):
    check_refusals(navigation, SOON_S)


def test_interrupt_and_violation_reach_client_and_function(navigation):
    check_interrupt_and_violation(navigation, SOON_S)


def test_a_hook_that_raises_fails_its_execution_only(navigation):
    navigation.bring(FLYING)
    navigation.hooks["goto_straight"].acts["on_dispatch"] = lambda execution: execution.inputs.nosuch
    handle = navigation.client.start("goto_straight", target=(1, 2, 3), speed=1)
    assert handle.wait(SOON_S)
    assert handle.state is S.FAILED
    assert handle.message == "on_dispatch raised AttributeError: 'GotoStraightInputs' object has no attribute 'nosuch'"
    navigation.hooks["goto_straight"].acts.clear()
    assert navigation.fly().state is S.RUNNING


def test_wrong_inputs_are_refused_before_anything_is_sent(navigation):
    for inputs, words in (
        ({"target": (1, 2), "speed": 1}, "target takes a geometry_msgs/Point or three numbers"),
        ({"target": (1, 2, "3"), "speed": 1}, "target, z takes a number"),
        ({"target": (1, 2, 3), "speed": True}, "speed takes a number"),
        ({"target": (1, 2, 3)}, "speed missing"),
        ({"target": (1, 2, 3), "velocity": 1}, "no 'velocity'; it has target, speed"),
    ):
        with pytest.raises(ValueError, match="goto_straight") as raised:
            navigation.client.start("goto_straight", **inputs)
        assert words in str(raised.value)
    with pytest.raises(ValueError, match="no skill 'fly'; it has takeoff"):
        navigation.client.start("fly")
    assert navigation.managers.engine.executions == ()
    handle = navigation.client.start("land")
    assert handle.wait(SOON_S)
    assert handle.state is S.NOT_READY


def test_generic_tools_need_no_generated_code(navigation):
    assert from_json(navigation.service(Describe, "describe").model_json) == navigation.managers.skillset
    assert not navigation.service(GetData, "get_data", name="nosuch").known
    before = navigation.service(GetData, "get_data", name="guidance_state")
    assert (before.known, before.received) == (True, False)
    publisher = navigation.node.create_publisher(GuidanceState, "/uav_guidance/state", 10)
    passed: list = []
    navigation.node.create_subscription(GuidanceState, "navigation/data/guidance_state", passed.append, EVENTS)

    def arrived() -> bool:
        publisher.publish(GuidanceState(reference="hover"))
        return bool(passed)

    until(arrived, "data is passed on")
    answer = navigation.service(GetData, "get_data", name="guidance_state")
    assert json.loads(answer.value_json)["reference"] == "hover"
    assert passed[0].reference == "hover"


def test_goals_have_the_right_states_for_plain_action_clients(navigation):
    navigation.bring(FLYING)
    client = ActionClient(navigation.node, navigation_actions.GotoStraight, "navigation/skill/goto_straight")
    assert client.wait_for_server(SOON_S)
    # Not the goal handle's own status: rclpy 7.1.6 drops a status that arrives before the answer to its goal.
    told: list = []
    status_topic = "navigation/skill/goto_straight/_action/status"
    navigation.node.create_subscription(GoalStatusArray, status_topic, told.append, qos_profile_action_status_default)

    def status(goal):
        return (
            {bytes(one.goal_info.goal_id.uuid): one.status for one in told[-1].status_list}.get(bytes(goal.goal_id.uuid)) if told else None
        )

    def run():
        sent = client.send_goal_async(navigation_actions.GotoStraight.Goal(speed=1.0))
        until(sent.done, "accepted")
        result = sent.result().get_result_async()
        until(lambda: navigation.managers.engine.executions or result.done(), "under way")
        return sent.result(), result

    goal, result = run()
    until(lambda: status(goal) == GoalStatus.STATUS_EXECUTING, "the status topic says executing")
    goal.cancel_goal_async()
    until(result.done, "canceled")
    assert (result.result().status, result.result().result.outcome) == (GoalStatus.STATUS_CANCELED, "INTERRUPTED")
    goal, result = run()
    until(lambda: navigation.managers.engine.executions[0].terminate("ARRIVED"), "terminated")
    until(result.done, "result")
    assert result.result().status == GoalStatus.STATUS_SUCCEEDED
    navigation.bring({"flight_status": "ON_GROUND"})
    _, result = run()
    until(result.done, "result")
    assert (result.result().status, result.result().result.outcome) == (GoalStatus.STATUS_ABORTED, "NOT_READY")
    client.destroy()


def test_what_hooks_have_outside_of_the_namespace_is_told(spinning):
    from geometry_msgs.msg import Point
    from navigation_interfaces.action import Hover
    from rclpy.node import Node
    from std_srvs.srv import Trigger

    from skillset_ros2 import ActionClient
    from skillset_ros2.names import names_outside

    node = spinning.spin(Node("hooks_outside", namespace="/uav1"))
    for slash in ("", "/"):
        node.create_subscription(Point, f"{slash}heard", print, 1)
        node.create_publisher(Point, f"{slash}told", 1)
        node.create_client(Trigger, f"{slash}called")
        ActionClient(node, Hover, f"{slash}done")
    assert names_outside(node) == ["/called", "/done", "/heard", "/told"]


def test_time_is_the_mission_clock_and_names_follow_the_namespace(spinning):
    parameters = [Parameter("use_sim_time", value=True)]
    navigation = Navigation(spinning, namespace="uav1", parameter_overrides=parameters)
    set_time = navigation.mission_clock()
    set_time(100.0)
    navigation.bring(FLYING)
    handle = navigation.fly()
    until(lambda: len(navigation.events) >= 6, "events")
    assert {event.header.stamp.sec for event in navigation.events} == {100}
    calls = navigation.hooks["goto_straight"].calls
    assert "progress" not in calls  # time stands still
    later = itertools.count(101)

    def progress_as_time_goes_on() -> bool:
        # Progress is due one period after the skill runs, by the managers' clock at that moment: one step of time may come before.
        set_time(float(next(later)))
        return "progress" in calls

    until(progress_as_time_goes_on, "progress follows the mission clock")
    until(lambda: handle.progress == 0.5, "and is reported")


def test_a_callback_that_raises_fails_what_runs_and_the_managers_live_on(ros2_domain):
    hooks = {skill.name: Recorder() for skill in SKILLSET.skills}
    managers = SkillsetNode(SKILLSET, navigation_actions, lambda _: hooks)
    stop = threading.Event()
    spinner = threading.Thread(target=spin_until, args=(managers, stop))
    spinner.start()
    for resource, state in FLYING.items():
        managers.engine.transition(resource, state)
    execution = managers.engine.request("hover", None)
    beats: list[int] = []

    def beat() -> None:
        beats.append(1)
        if len(beats) == 1:
            raise RuntimeError("no such field")

    managers.create_timer(0.01, beat)
    until(lambda: execution.done, "it is failed")
    assert (execution.state, execution.message) == (S.FAILED, "a callback raised RuntimeError: no such field")
    until(lambda: len(beats) > 2, "callbacks go on")
    assert managers.engine.request("hover", None).state is S.RUNNING
    stop.set()
    spinner.join(SOON_S)
    assert not spinner.is_alive()
    assert managers.engine.executions == ()
    managers.destroy_node()


def test_missing_hooks_are_named(ros2_domain):
    with pytest.raises(SkillRuntimeError, match="no hooks for takeoff, goto"):
        SkillsetNode(SKILLSET, navigation_actions, lambda _: {})


@pytest.fixture
def process(ros2_domain):
    started = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, str(Path(__file__).with_name("skillset_ros2_process.py")), *arguments]
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True))
        return started[-1]

    yield start
    for one in started:
        if one.poll() is None:
            os.killpg(one.pid, signal.SIGKILL)
        one.wait(5.0)
        one.stdout.close()


def flying(spinning) -> tuple[Node, SkillsetClient]:
    """Return a node and its client of the managers of a process, which have been told that the vehicle flies."""
    node = Node(f"skill_runtime_tester_{next(NUMBERS)}")
    client = SkillsetClient(node, "navigation")
    assert client.wait_ready(READY_S)
    spinning.spin(node)
    for resource, state in FLYING.items():
        take(node, resource, state)
    return node, client


@pytest.mark.parametrize("goals", [1, 5])
def test_managers_that_are_shut_down_send_the_results_of_their_goals(spinning, process, goals):
    """An action client of ROS 2 knows nothing of events: it hears by the result only, or never."""
    served = process("--ros-args", "-p", "use_sim_time:=false")
    node, client = flying(spinning)
    actions = ActionClient(node, navigation_actions.GotoStraight, "navigation/skill/goto_straight")
    assert actions.wait_for_server(READY_S)
    results: list[str] = []

    def ask(sent) -> None:
        sent.result().get_result_async().add_done_callback(lambda ended: results.append(ended.result().result.message))

    for _ in range(goals):
        actions.send_goal_async(navigation_actions.GotoStraight.Goal(speed=1.0)).add_done_callback(ask)
    until(lambda: client.resources["axes_authority"] == "USED" and len(results) == goals - 1, "one runs, the others are refused")
    served.send_signal(signal.SIGINT)
    until(lambda: len(results) == goals, "all have their results")
    assert results[-1] == "the managers were shut down"
    assert served.wait(SOON_S) == 0
    actions.destroy()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_client_waits_for_managers_that_are_gone(spinning, process, number):
    served = process("--ros-args", "-p", "use_sim_time:=false", "__name:=from_roslaunch")
    _, client = flying(spinning)
    handle = client.start("goto_straight", target=(1, 2, 3), speed=1)
    until(lambda: handle.state is S.RUNNING, "goto_straight runs")
    served.send_signal(number)
    assert handle.wait(SOON_S)
    assert handle.state is S.FAILED
    if number is signal.SIGINT:
        assert handle.message == "the managers were shut down"
        assert served.wait(SOON_S) == 0
        stops = [line for line in served.stdout.read().splitlines() if line.startswith("stopped")]
        assert stops == ["stopped goto_straight: the managers were shut down"]
    else:
        assert "the managers of navigation have gone" in handle.message
        assert_that_new_managers_are_found(client, process)


def assert_that_new_managers_are_found(client, process):
    until(lambda: not client.ready, "the client knows")
    late = client.start("goto_straight", target=(1, 2, 3), speed=1)
    assert (late.state, late.message) == (S.FAILED, "the managers of navigation are not there")
    process()
    assert client.wait_ready(READY_S)
    assert client.start("land").wait(SOON_S)


def test_the_loss_of_others_leaves_executions_alone(spinning):
    """As DDS tells it for a while after a crash: the end of earlier managers is not that of these."""
    navigation = Navigation(spinning)
    navigation.bring(FLYING)
    handle = navigation.fly()
    connection = navigation.client._connection
    asked = threading.Event()
    use = connection._use
    connection._use = lambda *answer: (use(*answer), asked.set())
    connection.on_doubt()
    assert asked.wait(SOON_S)
    assert navigation.client.ready
    assert handle.state is S.RUNNING
