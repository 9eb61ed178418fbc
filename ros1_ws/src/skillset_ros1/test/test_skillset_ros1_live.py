"""Managers and client on a live ROS 1 graph, with the drone's generated navigation."""

from __future__ import annotations

import json
import threading

import actionlib
import pytest
import rospy
from actionlib.action_client import CommState
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import Point
from navigation_interfaces.msg import LandActionResult, TakeoffAction, TakeoffActionGoal, TakeoffActionResult, TakeoffGoal
from navigation_managers.client import NavigationClient
from navigation_managers.inputs import GotoStraightInputs
from skillset_interfaces.msg import Event
from skillset_interfaces.srv import Describe, GetData, TriggerEvent, Why
from skillset_ros1_bench import SOON_S, Navigation, on_thread
from uav_msgs.msg import GuidanceState

from alula.model.execution_state import ExecutionState
from alula.model.json_form import from_json
from alula.runtime.waiting import CannotWaitError
from alula_testing.navigation import FLYING, check_interrupt_and_violation, check_refusals
from alula_testing.waits import until
from skillset_ros1.actions import RESULTS_KEPT

S = ExecutionState


@pytest.fixture
def navigation(ros_master):
    bench = Navigation()
    yield bench
    bench.close()


def test_an_execution_from_request_to_result(navigation):
    navigation.bring(FLYING)
    seen = []
    until(lambda: navigation.client.resources.get("flight_status") == "IN_AIR", "the client follows")
    navigation.client.on_change(seen.append)
    handle = navigation.fly()
    execution = navigation.execution(handle)
    assert execution.inputs == GotoStraightInputs(target=Point(x=1.0, y=2.5, z=3.0), speed=1.0)
    until(lambda: handle.progress == 0.5, "progress is reported every period")
    states_at_end = []
    handle.add_done_callback(lambda _: states_at_end.append(navigation.client.resources["axes_authority"]))
    execution.terminate("ARRIVED", "there")
    assert handle.wait(SOON_S)
    assert (handle.state, handle.outcome, handle.result, handle.message) == (S.TERMINATED, "TERMINATED", "ARRIVED", "there")
    until(lambda: states_at_end == ["AVAILABLE"], "a callback that is told of the end sees the resources after it")
    assert [states["axes_authority"] for states in seen] == ["USED", "AVAILABLE"]


def test_refusals_reach_the_caller(navigation):
    check_refusals(navigation, SOON_S)


def test_a_second_caller_is_refused_while_the_first_goes_on(navigation):
    navigation.bring(FLYING)
    first = navigation.fly()
    second = navigation.another_client().start("goto_straight", target=(0, 0, 0), speed=1)
    assert second.wait(SOON_S)
    assert (second.state, second.result) == (S.NOT_READY, "not_moving")
    assert first.state is S.RUNNING
    navigation.execution(first).terminate("ARRIVED")
    assert first.wait(SOON_S)
    assert first.result == "ARRIVED"


def test_interrupt_and_violation_reach_client_and_function(navigation):
    check_interrupt_and_violation(navigation, SOON_S)


def test_a_hook_that_waits_holds_up_no_other_skill(navigation):
    navigation.bring(FLYING)
    go_on = threading.Event()
    navigation.hooks["hover"].acts["validate"] = lambda _: "" if go_on.wait(SOON_S) else "the test did not let the hook go on"
    slow = navigation.client.start("hover", duration=1)
    handle = navigation.fly()
    navigation.execution(handle).terminate("ARRIVED")
    assert handle.wait(SOON_S)
    assert not slow.done
    go_on.set()
    until(lambda: slow.state is S.RUNNING, "the slow one is validated")


def test_a_hook_that_raises_fails_its_execution_only(navigation):
    navigation.bring(FLYING)

    def break_down(_):
        raise OSError("no link")

    navigation.hooks["hover"].acts["on_dispatch"] = break_down
    handle = navigation.client.start("hover", duration=1)
    assert handle.wait(SOON_S)
    assert (handle.state, handle.message) == (S.FAILED, "on_dispatch raised OSError: no link")
    until(lambda: navigation.client.resources["axes_authority"] == "AVAILABLE", "its effect is undone")
    assert navigation.fly().state is S.RUNNING


def test_wrong_inputs_are_the_callers_error(navigation):
    with pytest.raises(ValueError, match=r"inputs of navigation\.takeoff: speed missing"):
        navigation.client.start("takeoff", height=3)
    with pytest.raises(ValueError, match=r"inputs of navigation.takeoff, height takes a number \(float64\), not 'high'"):
        navigation.client.start("takeoff", height="high", speed=1)
    with pytest.raises(ValueError, match="has no skill 'fly'; it has takeoff, goto"):
        navigation.client.start("fly")


def test_any_actionlib_client_gets_its_answers(navigation):
    navigation.bring({"SDK_authority": "AVAILABLE", "homepoint_status": "VALID"})
    # Not a SimpleActionClient: one of Python misses an end that comes before its `send_goal` returns (github.com/ros/actionlib/issues/206).
    client = actionlib.ActionClient(navigation.name("skill/takeoff"), TakeoffAction)
    assert client.wait_for_server(rospy.Duration(SOON_S))

    def answer(goal):
        until(lambda: goal.get_comm_state() == CommState.DONE, "it is answered")
        return goal.get_terminal_state(), goal.get_result()

    navigation.hooks["takeoff"].acts["validate"] = lambda inputs: "" if inputs.height < 10 else "too high"
    status, refusal = answer(client.send_goal(TakeoffGoal(height=30, speed=1)))
    assert (status, refusal.outcome, refusal.message) == (GoalStatus.REJECTED, "NOT_VALIDATED", "too high")
    navigation.hooks["takeoff"].acts["on_dispatch"] = lambda execution: on_thread(lambda: execution.terminate("AT_ALTITUDE"))
    status, end = answer(client.send_goal(TakeoffGoal(height=3, speed=1)))
    assert (status, end.outcome, end.result) == (GoalStatus.SUCCEEDED, "TERMINATED", "AT_ALTITUDE")
    navigation.hooks["takeoff"].acts.pop("on_dispatch")
    flying = client.send_goal(TakeoffGoal(height=3, speed=1))
    until(lambda: flying.get_goal_status() == GoalStatus.ACTIVE, "it runs")
    flying.cancel()
    status, end = answer(flying)
    assert (status, end.outcome) == (GoalStatus.PREEMPTED, "INTERRUPTED")


def test_a_cancellation_that_overtakes_its_goal(navigation):
    results = []
    place = navigation.name("skill/takeoff")
    goals = rospy.Publisher(f"{place}/goal", TakeoffActionGoal, queue_size=1)
    cancels = rospy.Publisher(f"{place}/cancel", GoalID, queue_size=1)
    listening = rospy.Subscriber(f"{place}/result", TakeoffActionResult, results.append)
    until(lambda: goals.get_num_connections() and cancels.get_num_connections() and listening.get_num_connections(), "connected")
    server = navigation.managers.skills["takeoff"].server.server
    cancels.publish(GoalID(id="early"))
    until(lambda: any(status.status.goal_id.id == "early" for status in server.status_list), "the cancellation is there")
    goals.publish(TakeoffActionGoal(goal_id=GoalID(id="early"), goal=TakeoffGoal(height=3, speed=1)))
    until(lambda: results, "the goal is answered")
    assert (results[0].status.status, results[0].result.outcome) == (GoalStatus.RECALLED, "INTERRUPTED")
    assert "validate" not in navigation.hooks["takeoff"].calls


def test_a_late_subscriber_hears_all_events(navigation):
    navigation.bring(FLYING)
    handle = navigation.fly()
    navigation.execution(handle).terminate("ARRIVED", "there")
    assert handle.wait(SOON_S)
    # Subscribers of one process share a connection: the first one's must go, or none would be late.
    navigation.client.close()
    heard = {}
    late = rospy.Subscriber(navigation.name("events"), Event, lambda event: heard.setdefault(event.sequence, event))
    until(lambda: any(event.state == "TERMINATED" for event in heard.values()), "the history comes")
    late.unregister()
    events = [heard[number] for number in sorted(heard)]
    assert [event.sequence for event in events] == list(range(1, len(events) + 1))
    held = ["axes_authority", "heading_authority"]
    told = [event.resource or event.state for event in events[len(FLYING) :]]
    assert told == ["REQUESTED", *held, "RUNNING", *held, "TERMINATED"]
    first = next(event for event in events if event.state == "REQUESTED")
    assert json.loads(first.inputs_json) == {"target": {"x": 1.0, "y": 2.5, "z": 3.0}, "speed": 1.0}


def test_the_last_results_of_a_skill_are_kept_for_plain_subscribers_however_late(navigation):
    client = navigation.client
    handles = []
    for _ in range(RESULTS_KEPT + 1):  # one after the other: of those that are asked for together any may end first
        handles.append(client.start("land"))
        assert handles[-1].wait(SOON_S)
    # Subscribers of one process share a connection: the first one's must go, or none would be late.
    client.close()
    heard = []
    late = rospy.Subscriber(navigation.name("skill/land/result"), LandActionResult, heard.append)
    until(lambda: len(heard) == RESULTS_KEPT, "the history comes")
    late.unregister()
    assert [one.status.goal_id.id for one in heard] == [handle.id for handle in handles[1:]]
    assert {(one.status.status, one.result.outcome) for one in heard} == {(GoalStatus.REJECTED, "NOT_READY")}


def test_description_and_data(navigation):
    assert from_json(navigation.service(Describe, "describe").model_json) == navigation.managers.engine.skillset
    assert navigation.client.model == navigation.managers.engine.skillset
    assert not navigation.service(GetData, "get_data", name="nonsense").known
    answer = navigation.service(GetData, "get_data", name="guidance_state")
    assert (answer.known, answer.received) == (True, False)
    source = rospy.Publisher("/uav_guidance/state", GuidanceState, queue_size=1, latch=True)
    source.publish(GuidanceState())
    until(lambda: navigation.service(GetData, "get_data", name="guidance_state").received, "the data manager hears it")
    answer = navigation.service(GetData, "get_data", name="guidance_state")
    assert json.loads(answer.value_json)["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    passed_on = rospy.wait_for_message(navigation.name("data/guidance_state"), GuidanceState, timeout=SOON_S)
    assert isinstance(passed_on, GuidanceState)
    source.unregister()


def test_a_closed_client_leaves_no_handle_open(navigation):
    navigation.bring(FLYING)
    handle = navigation.fly()
    navigation.client.close()
    assert handle.wait(SOON_S)
    assert (handle.state, handle.message) == (S.FAILED, "the client of navigation was closed")
    late = navigation.client.start("land")
    assert (late.state, late.message) == (S.FAILED, "the managers of navigation are not there")


def test_questions_are_answered(navigation):
    client = navigation.client
    answer = client.why("hover").get(SOON_S)
    assert (answer.ready, [one.name for one in answer.unmet]) == (False, ["sdk_authority", "in_air"])
    navigation.bring(FLYING)
    navigation.hooks["hover"].acts["validate"] = lambda inputs: "" if inputs.duration > 0 else "no time"
    assert client.why("hover", {"duration": 1}).get(SOON_S).ready
    refused = client.why("hover", {"duration": 0}).get(SOON_S)
    assert (refused.ready, "no time" in refused.reason) == (False, True)
    assert refused.history[0].cause == "extern"
    with pytest.raises(ValueError, match="has no skill 'fly'"):
        client.why("fly")
    taken = client.transition("SDK_authority", "UNAVAILABLE").get(SOON_S)
    assert (taken.accepted, taken.state) == (True, "UNAVAILABLE")
    assert client.input_types("hover") == {"duration": "float64"}
    answer = navigation.service(Why, "why", skill="hover", inputs_json="3")
    assert (answer.known, answer.reason) == (False, "inputs of hover are a JSON object, not 3")
    answer = navigation.service(TriggerEvent, "trigger", event="storm")
    assert (answer.accepted, "storm" in answer.reason) == (False, True)


def test_pause_and_resume(navigation):
    navigation.bring(FLYING)
    handle = navigation.fly()
    assert handle.pause().get(SOON_S) == "goto_straight can't be paused"
    navigation.hooks["goto_straight"].acts |= {"on_pause": lambda _: "", "on_resume": lambda _: ""}
    assert handle.pause().get(SOON_S) == ""
    until(lambda: handle.state is S.PAUSED, "it rests")
    assert handle.resume().get(SOON_S) == ""
    until(lambda: handle.state is S.RUNNING, "it goes on")


def test_a_late_client_learns_the_last_results(navigation):
    navigation.bring(FLYING)
    handle = navigation.fly()
    navigation.execution(handle).terminate("ARRIVED", "there")
    assert handle.wait(SOON_S)
    navigation.client.close()
    late = navigation.another_client()
    until(lambda: late.last("goto_straight"), "the last result is told")
    last = late.last("goto_straight")
    assert (last.id, last.outcome, last.result, last.message) == (handle.id, "TERMINATED", "ARRIVED", "there")
    assert late.last("hover") is None


def test_all_executions_of_a_skill_are_interrupted(navigation):
    navigation.bring(FLYING)
    handle = navigation.fly()
    stranger = navigation.another_client()
    stranger.interrupt_all("goto_straight").get(SOON_S)
    assert handle.wait(SOON_S)
    assert handle.state is S.INTERRUPTED


def test_a_stop_that_takes_too_long_becomes_an_emergency(ros_master):
    rospy.set_param("~interrupt_timeout_s", 0.3)
    try:
        navigation = Navigation()
    finally:
        rospy.delete_param("~interrupt_timeout_s")
    navigation.bring(FLYING)
    navigation.hooks["goto_straight"].acts["on_interrupt"] = lambda _: False
    handle = navigation.fly()
    handle.interrupt()
    until(lambda: handle.state is S.INTERRUPTING or handle.done, "the stop has begun")
    assert handle.wait(SOON_S)
    assert handle.state is S.INTERRUPTED
    # A hook is called beside the execution's end, which waits for none.
    until(lambda: "on_emergency" in navigation.hooks["goto_straight"].calls, "the emergency stop")
    navigation.close()
    assert navigation.hooks["goto_straight"].calls.count("on_emergency") == 1


def test_data_are_followed_without_generated_code(navigation):
    source = rospy.Publisher("/uav_guidance/state", GuidanceState, queue_size=1, latch=True)
    source.publish(GuidanceState(armed=True))
    feed = navigation.client.data_feed("guidance_state")
    until(lambda: feed.sample is not None and feed.sample.stamp_ns is not None, "the value comes, and its stamp")
    assert feed.sample.value.armed
    until(lambda: feed.stale, "three periods later it is stale")
    source.unregister()


def test_the_generated_client_works_here_too(navigation):
    navigation.bring(FLYING)
    skills = NavigationClient(navigation.client)
    handle = skills.hover(duration=1)
    until(lambda: handle.state is S.RUNNING, "it runs")
    assert skills.axes_authority.becomes("USED").get(SOON_S) == "USED"
    handle.interrupt()
    assert handle.get(SOON_S).state is S.INTERRUPTED


def test_a_wait_on_the_thread_that_brings_the_news_is_refused(navigation):
    navigation.bring(FLYING)
    caught = []

    def wait_there(_):
        try:
            navigation.client.start("hover", duration=1).wait(SOON_S)
        except CannotWaitError as error:
            caught.append(str(error))

    navigation.client.on_change(wait_there)
    navigation.client.transition("homepoint_status", "INVALID")
    until(lambda: caught, "it is refused")
    assert "can't wait" in caught[0]
