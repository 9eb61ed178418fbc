"""Stops, pauses and answers over the live interface."""

from __future__ import annotations

import json
import threading
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from action_msgs.msg import GoalStatus  # noqa: E402
from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from skillset_interfaces.msg import Heartbeat, SkillStates  # noqa: E402
from skillset_interfaces.srv import SetPaused, Why  # noqa: E402
from skillset_ros2_rig import READY_S, SOON_S, Navigation, until  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.runtime.core.errors import SkillRuntimeError  # noqa: E402
from alula.runtime.hooks import SkillHooks  # noqa: E402
from alula.runtime.middleware import ALIVE_PERIOD_S  # noqa: E402
from alula.runtime.workers import Workers  # noqa: E402
from alula_testing.navigation import FLYING  # noqa: E402
from skillset_ros2 import ActionClient, SkillsetNode  # noqa: E402
from skillset_ros2.middleware import EARLY_S, until_beat_s  # noqa: E402
from skillset_ros2.names import LATCHED  # noqa: E402

S = ExecutionState


def latest(navigation) -> dict[str, SimpleNamespace]:
    """What a late client is told: its subscription is made now."""
    heard: list = []
    subscription = navigation.node.create_subscription(SkillStates, "navigation/skill_states", heard.append, LATCHED)
    until(lambda: heard, "the latched skill states")
    navigation.node.destroy_subscription(subscription)
    return {skill.name: skill for skill in heard[-1].skills}


def test_a_late_client_learns_the_last_result_of_every_skill(anyhow):
    navigation = anyhow
    navigation.bring(FLYING)
    handle = navigation.fly()
    until(lambda: [e.state for e in latest(navigation)["goto_straight"].open] == ["RUNNING"], "open")
    navigation.managers.engine.terminate(handle.id, "ARRIVED", "there")
    assert handle.wait(SOON_S)
    until(lambda: latest(navigation)["goto_straight"].last, "ended")
    skills = latest(navigation)
    last = skills["goto_straight"].last[0]
    assert (last.id, last.state, last.result, last.message) == (handle.id, "TERMINATED", "ARRIVED", "there")
    assert json.loads(last.inputs_json)["target"] == {"x": 1.0, "y": 2.5, "z": 3.0}
    assert 0 < last.requested_ns <= last.started_ns <= last.ended_ns
    assert (skills["land"].open, skills["land"].last) == ([], [])


def test_managers_that_answer_after_they_were_given_up_are_found_again(anyhow):
    navigation, go_on = anyhow, threading.Event()
    try:
        navigation.managers.executor.create_task(lambda: go_on.wait(READY_S))
        navigation.node.executor.create_task(navigation.client._connection.on_doubt)
        until(lambda: not navigation.client.ready, "managers that say nothing are given up")
    finally:
        go_on.set()
    until(lambda: navigation.client.ready, "their late answer counts as a heartbeat")


def test_heartbeats_are_messages_too_and_end_where_the_executor_hangs(anyhow):
    """Another world hears nothing of DDS liveliness."""
    navigation, go_on, hangs = anyhow, threading.Event(), threading.Event()
    heard: list[Heartbeat] = []
    periods: list[None] = []
    navigation.node.create_subscription(Heartbeat, "navigation/alive", heard.append, LATCHED)
    until(lambda: len(heard) >= 3, "heartbeats come again and again")
    assert {beat.instance_id for beat in heard} == {navigation.managers.managers.instance_id}

    def hang() -> None:
        hangs.set()
        go_on.wait(READY_S)

    try:
        navigation.managers.executor.create_task(hang)
        assert hangs.wait(READY_S)
        count = len(heard)
        navigation.node.create_timer(ALIVE_PERIOD_S, lambda: periods.append(None))
        until(lambda: len(periods) >= 4, "time goes by")
        assert len(heard) <= count + 1, "one may have been under way"
    finally:
        go_on.set()
    until(lambda: len(heard) >= count + 3, "and go on")


@pytest.mark.parametrize("late_s", [0.0, 0.001, 0.2, ALIVE_PERIOD_S - 2 * EARLY_S])
def test_heartbeats_of_all_skillsets_are_due_at_the_same_moments(late_s):
    """Whenever managers begin, and however late they send one."""
    assert until_beat_s(1000 * ALIVE_PERIOD_S + late_s) == pytest.approx(ALIVE_PERIOD_S - late_s)


def test_a_heartbeat_that_is_early_by_a_moment_is_not_sent_twice():
    assert until_beat_s(1000 * ALIVE_PERIOD_S - EARLY_S / 2) == pytest.approx(ALIVE_PERIOD_S + EARLY_S / 2)


def test_why_answers_over_the_graph(anyhow):
    navigation = anyhow
    answer = navigation.service(Why, "why", skill="goto_straight")
    assert (answer.known, answer.ready) == (True, False)
    first = answer.unmet[0]
    assert (first.name, [(r.name, r.state) for r in first.resources]) == ("sdk_authority", [("SDK_authority", "UNAVAILABLE")])
    assert "SDK_authority is UNAVAILABLE" in answer.reason
    navigation.bring(FLYING)
    answer = navigation.service(Why, "why", skill="goto_straight")
    assert (answer.ready, answer.reason, answer.unmet) == (True, "", [])
    assert [(t.resource, t.to_state, t.cause) for t in answer.history] == [(name, state, "extern") for name, state in FLYING.items()]
    navigation.hooks["takeoff"].acts["validate"] = lambda inputs: f"{inputs.height} m is too high"
    answer = navigation.service(Why, "why", skill="takeoff", inputs_json='{"height": 300, "speed": 1}')
    assert (answer.ready, answer.refusal) == (False, "300.0 m is too high")
    assert not navigation.service(Why, "why", skill="nosuch").known
    answer = navigation.service(Why, "why", skill="takeoff", inputs_json='{"hight": 300}')
    assert (answer.known, "no 'hight'" in answer.reason) == (False, True)
    assert navigation.managers.engine.executions == ()


def test_a_stop_has_two_phases_and_a_pause_is_seen(anyhow):
    navigation = anyhow
    navigation.bring(FLYING)
    phases: list[str] = []
    client = ActionClient(navigation.node, navigation_actions.GotoStraight, "navigation/skill/goto_straight")
    assert client.wait_for_server(SOON_S)
    sent = client.send_goal_async(navigation_actions.GotoStraight.Goal(speed=1.0), lambda m: phases.append(m.feedback.state))
    until(lambda: "RUNNING" in phases, "feedback says RUNNING")
    execution = navigation.managers.engine.executions[0]
    assert navigation.service(SetPaused, "pause", id=execution.id, paused=True).accepted
    until(lambda: "PAUSED" in phases, "feedback says PAUSED")
    assert navigation.service(SetPaused, "pause", id=execution.id, paused=False).accepted
    navigation.hooks["goto_straight"].acts["on_interrupt"] = lambda _: False
    sent.result().cancel_goal_async()
    until(lambda: phases[-1] == "INTERRUPTING", "feedback says INTERRUPTING")
    refused = navigation.service(SetPaused, "pause", id=execution.id, paused=True)
    assert (refused.accepted, "INTERRUPTING" in refused.reason) == (False, True)
    result = sent.result().get_result_async()
    assert execution.interrupted("hovering")
    until(result.done, "result")
    assert (result.result().status, result.result().result.outcome) == (GoalStatus.STATUS_CANCELED, "INTERRUPTED")
    told = ["REQUESTED", "RUNNING", "PAUSED", "RUNNING", "INTERRUPTING", "INTERRUPTED"]
    until(lambda: [event.state for event in navigation.events if event.state] == told, "events")
    client.destroy()


@pytest.mark.parametrize("separate", [False, True])
def test_the_emergency_follows_the_mission_clock(spinning, separate):
    parameters = [Parameter("use_sim_time", value=True), Parameter("interrupt_timeout_s", value=3.0)]
    navigation = Navigation(spinning, separate=separate, parameter_overrides=parameters)
    set_time = navigation.mission_clock()
    set_time(100.0)
    navigation.bring(FLYING)
    handle = navigation.fly()
    hooks = navigation.hooks["goto_straight"]
    release = threading.Event()
    hooks.acts["on_interrupt"] = lambda _: release.wait(60.0)
    handle.interrupt()
    until(lambda: "on_interrupt" in hooks.calls, "the stop is asked for")
    set_time(102.9)
    assert "on_emergency" not in hooks.calls
    assert not handle.done
    set_time(103.1)
    assert handle.wait(SOON_S)
    assert handle.state is S.INTERRUPTED
    assert handle.message == "the stop did not end within 3 s; the emergency stop was called"
    until(lambda: "on_emergency" in hooks.calls, "the emergency stop")
    release.set()


def test_hooks_that_hang_hold_up_no_other_skill(anyhow):
    navigation = anyhow
    navigation.bring(FLYING)
    release = threading.Event()
    navigation.hooks["goto_straight"].acts["validate"] = lambda _: str(release.wait(60.0))
    stuck = [navigation.client.start("goto_straight", target=(0, 0, 0), speed=1) for _ in range(20)]
    until(lambda: navigation.hooks["goto_straight"].calls.count("validate") == 20, "all of them hang")
    other = navigation.client.start("land")
    until(lambda: other.state is S.RUNNING, "another skill runs")
    for handle in stuck:
        handle.interrupt()
    assert all(handle.wait(SOON_S) and handle.state is S.INTERRUPTED for handle in stuck)
    release.set()


def test_inputs_that_cannot_be_made_end_their_request_only(anyhow):
    navigation = anyhow
    navigation.bring(FLYING)

    def burst(_):
        raise RuntimeError("no such frame")

    navigation.hooks["goto"].make_inputs = burst
    running = navigation.fly()
    handle = navigation.client.start("goto", target=(0, 0, 0), speed=1)
    assert handle.wait(SOON_S)
    assert handle.state is S.FAILED
    assert "RuntimeError: no such frame" in handle.message
    assert running.state is S.RUNNING


@pytest.mark.parametrize("hook", ["validate", "progress"])
def test_a_hook_that_does_not_return_is_given_up_with_the_reason(spinning, hook):
    navigation = Navigation(spinning, parameter_overrides=[Parameter("hook_timeout_s", value=0.5)])
    navigation.bring(FLYING)
    release = threading.Event()
    navigation.hooks["hover"].acts[hook] = lambda _: release.wait(60.0)
    hung = navigation.client.start("hover", duration=1)
    assert hung.wait(SOON_S)
    assert (hung.state, hung.message) == (S.FAILED, f"{hook} has not returned within 0.5 s")
    assert navigation.fly().state is S.RUNNING
    release.set()


@pytest.mark.parametrize("name", ["interrupt_timeout_s", "hook_timeout_s"])
def test_a_limit_that_is_none_is_refused(ros2_domain, name):
    hooks = {skill.name: SkillHooks() for skill in SKILLSET.skills}
    with pytest.raises(SkillRuntimeError, match=f"{name} is 0"):
        SkillsetNode(SKILLSET, navigation_actions, lambda _: hooks, parameter_overrides=[Parameter(name, value=0.0)])


def test_workers_never_wait_for_each_other_and_end():
    release, done, errors = threading.Event(), threading.Semaphore(0), []
    workers = Workers("test", errors.append)
    for _ in range(50):
        workers.submit(lambda: release.wait(20.0))
    workers.submit(done.release)
    assert done.acquire(timeout=20.0)
    workers.submit(lambda: 1 / 0)
    assert not workers.close(0.05)
    release.set()
    assert workers.close(20.0)
    assert ["ZeroDivisionError" in error for error in errors] == [True]
