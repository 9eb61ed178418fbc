"""The typed client of the drone against real managers: every way to wait, and the ends of all waits."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("uav_client")

from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from skillset_ros2_client_rig import NUMBERS, READY_S, READY_TO_TAKE_OFF, SOON_S, Managers, Spun, until  # noqa: E402
from uav_client import Uav  # noqa: E402
from uav_msgs.msg import GuidanceState  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.runtime.handle import SkillFailedError  # noqa: E402
from alula.runtime.staleness import STALE_PERIODS  # noqa: E402
from alula.runtime.waiting import CannotWaitError, NoResponseError  # noqa: E402
from skillset_ros2 import Robot  # noqa: E402
from skillset_ros2.robot import NotThereError  # noqa: E402

S = ExecutionState
NAVIGATION = ("navigation",)


@pytest.fixture(scope="module")
def served(ros2_domain):
    managers = Managers()
    yield managers
    managers.close()


@pytest.fixture(scope="module")
def connected(served, ros2_domain):
    with Uav.connect(domain=ros2_domain, skillsets=NAVIGATION, timeout_s=READY_S) as robot:
        yield robot


@pytest.fixture
def managers(served):
    served.reset()
    return served


@pytest.fixture
def uav(managers, connected):
    """The client, as soon as it sees the resources as they are."""
    states = {name: status.state for name, status in managers.engine.resources.items()}
    until(lambda: connected.navigation.client.resources == states, "the client has heard of the reset")
    return connected


def arrive(managers):
    managers.running().terminate("AT_ALTITUDE", "there")


def test_actions_rest_unless_an_answer_is_due(managers, uav):
    group = uav.navigation.client._middleware._group
    may_rest = set(group.resting)
    waited_for = lambda: [entity for entity in may_rest if entity not in group.resting]  # noqa: E731
    until(lambda: waited_for() == [], "nothing is due of earlier goals")
    handle = uav.navigation.takeoff(height=5.0, speed=1.0)
    managers.running()
    until(lambda: handle.progress == 0.5, "feedback comes while the goal runs")
    until(lambda: [getattr(one, "topic_name", "") for one in waited_for()] == ["/navigation/skill/takeoff/_action/feedback"], "that")
    managers.running().terminate("AT_ALTITUDE", "there")
    assert handle.get(SOON_S).result == "AT_ALTITUDE"
    until(lambda: waited_for() == [], "nothing is due any more")


def test_a_script_calls_a_skill_and_waits(uav, managers):
    takeoff = uav.navigation.takeoff
    handle = takeoff(height=5.0, speed=1.0)
    execution = managers.running()
    assert (execution.id, execution.inputs.height) == (handle.id, 5.0)
    reports = iter(handle)
    states = [next(reports).state]
    until(lambda: handle.progress == 0.5, "progress is reported")
    execution.terminate("AT_ALTITUDE", "there")
    ended = handle.get(SOON_S)
    assert (ended.state, ended.result, ended.message) == (S.TERMINATED, "AT_ALTITUDE", "there")
    assert ended.expect("AT_ALTITUDE") is ended
    states += [report.state for report in reports]
    assert states[-1] is S.TERMINATED
    assert S.RUNNING in states
    until(lambda: takeoff.last == ended, "the last end is known")


def test_a_late_client_learns_the_last_ends(managers, ros2_domain):
    managers.engine.request("takeoff", None)
    managers.running().terminate("BLOCKED", "a branch")
    managers.engine.request("land", None)
    with Uav.connect(domain=ros2_domain, skillsets=NAVIGATION, timeout_s=READY_S) as late:
        until(lambda: late.navigation.land.last is not None, "the last end is known")
        last = late.navigation.takeoff.last
        assert last is not None
        assert (last.outcome, last.result, last.message) == ("TERMINATED", "BLOCKED", "a branch")
        assert late.navigation.land.last.outcome == "NOT_READY"
        assert late.navigation.hover.last is None


def test_a_busy_skill_refuses_the_second_caller_and_goes_on_for_the_first(uav, managers, ros2_domain):
    first = uav.navigation.takeoff(height=5.0, speed=1.0)
    managers.running()
    with Robot.connect("navigation", domain=ros2_domain, timeout_s=READY_S) as other:
        second = other["navigation"].takeoff(height=3.0, speed=1.0)
        refused = second.get(SOON_S)
        assert (refused.id, refused.outcome, refused.result) == (second.id, "NOT_READY", "not_moving")
        with pytest.raises(SkillFailedError, match="axes_authority is USED"):
            refused.expect()
        assert first.state is S.RUNNING
        first.interrupt()
        assert first.get(SOON_S).state is S.INTERRUPTED
        assert other["navigation"].axes_authority.becomes("AVAILABLE").get(SOON_S) == "AVAILABLE"


def test_pause_and_resume_where_the_hooks_can(uav, managers):
    handle = uav.navigation.takeoff(height=5.0, speed=1.0)
    managers.running()
    assert handle.pause().get(SOON_S) == ""
    until(lambda: handle.state is S.PAUSED, "it is paused")
    assert handle.resume().get(SOON_S) == ""
    until(lambda: handle.state is S.RUNNING, "it is resumed")
    managers.hooks["takeoff"].acts["on_pause"] = lambda execution: "not in a climb"
    assert handle.pause().get(SOON_S) == "not in a climb"
    del managers.hooks["takeoff"].acts["on_pause"]
    handle.interrupt()
    assert handle.get(SOON_S).state is S.INTERRUPTED
    assert handle.pause().get(SOON_S) == "takeoff has ended"


def test_asyncio_awaits_skills_resources_and_data(uav, managers):
    async def main() -> None:
        handle = uav.navigation.takeoff(height=5.0, speed=1.0)
        flying = uav.navigation.flight_status.becomes("IN_AIR")

        async def climb() -> list[str]:
            return [report.state.value async for report in handle]

        climbing = asyncio.create_task(climb())
        await asyncio.to_thread(managers.running)
        managers.bring({"flight_status": "IN_AIR"})
        assert await asyncio.wait_for(flying, SOON_S) == "IN_AIR"
        await asyncio.to_thread(arrive, managers)
        assert (await asyncio.wait_for(handle, SOON_S)).expect("AT_ALTITUDE")
        assert (await climbing)[-1] == "TERMINATED"

    asyncio.run(main())


def test_callbacks_and_coroutines_of_an_rclpy_node(managers):
    """In a callback of the spinning thread a blocking wait says so instead of deadlocking; ``await`` works there."""
    node = Node(f"skill_runtime_client_{next(NUMBERS)}")
    uav = Uav(node)
    assert uav.wait_ready(READY_S, NAVIGATION)  # only the wait spins the node
    told: dict[str, object] = {}
    over = threading.Event()

    async def fly() -> None:
        timer.cancel()
        handle = uav.navigation.takeoff(height=5.0, speed=1.0)
        try:
            handle.wait(SOON_S)
        except CannotWaitError as error:
            told["wait"] = str(error)
        try:
            next(handle.reports())  # the first is there
            list(handle)
        except CannotWaitError as error:
            told["iterate"] = str(error)
        told["end"] = (await handle).result
        told["reports"] = [report.state async for report in handle]
        over.set()

    timer = node.create_timer(0.01, fly)
    spun = Spun(node)
    managers.running().terminate("AT_ALTITUDE")
    assert over.wait(SOON_S), told
    spun.close()
    assert told["wait"] == told["iterate"]
    assert "this thread spins the node" in told["wait"]
    assert "await it" in told["wait"]
    assert (told["end"], told["reports"]) == ("AT_ALTITUDE", [S.TERMINATED])


def test_a_callback_may_wait_where_other_threads_spin(managers):
    node = Node(f"skill_runtime_client_{next(NUMBERS)}")
    uav = Uav(node)
    ends: list[str] = []

    def fly() -> None:
        timer.cancel()
        uav.wait_ready(READY_S, NAVIGATION)
        ends.append(uav.navigation.takeoff(height=5.0, speed=1.0).get(SOON_S).outcome)

    timer = node.create_timer(0.01, fly)
    spun = Spun(node, MultiThreadedExecutor(num_threads=3))
    managers.running().terminate("AT_ALTITUDE")
    until(lambda: ends, "the callback has waited for the skill")
    spun.close()
    assert ends == ["TERMINATED"]


def test_a_wait_spins_a_node_that_is_not_spun(managers):
    node = Node(f"skill_runtime_client_{next(NUMBERS)}")
    uav = Uav(node)
    assert uav.wait_ready(READY_S, NAVIGATION)
    handle = uav.navigation.takeoff(height=5.0, speed=1.0)
    ender = threading.Thread(target=lambda: arrive(managers))
    ender.start()
    assert handle.get(SOON_S).result == "AT_ALTITUDE"
    assert [report.state for report in uav.navigation.land()][-1] is S.NOT_READY
    ender.join(SOON_S)
    assert node.executor is None
    executor = SingleThreadedExecutor()
    executor.add_node(node)  # has it, and does not spin: the time ends the wait
    assert not uav.navigation.takeoff(height=5.0, speed=1.0).wait(0.05)
    executor.shutdown()
    node.destroy_node()


def test_resources_are_attributes_with_callbacks_and_extern_transitions(uav, managers):
    status = uav.navigation.flight_status
    assert status.state == "ON_GROUND"
    seen: list[str] = []
    forget = status.on_change(seen.append)
    airborne = status.becomes("IN_AIR")
    answer = status.transition("IN_AIR").get(SOON_S)
    assert (answer.accepted, answer.reason, answer.state) == (True, "", "IN_AIR")
    assert airborne.get(SOON_S) == "IN_AIR"
    assert status.becomes("IN_AIR").done
    managers.bring({"homepoint_status": "INVALID"})  # of another resource: not told
    assert status.transition("ON_GROUND").get(SOON_S).accepted
    until(lambda: seen == ["IN_AIR", "ON_GROUND"], "both changes are told")
    forget()
    refused = uav.navigation.axes_authority.transition("USED").get(SOON_S)
    assert (refused.accepted, refused.state) == (False, "AVAILABLE")
    assert "for skills only" in refused.reason
    until(lambda: uav.navigation.homepoint_status.state == "INVALID", "the state follows")
    assert seen == ["IN_AIR", "ON_GROUND"]


def test_data_are_attributes_with_stamp_and_staleness(uav, managers):
    publisher = managers.node.create_publisher(GuidanceState, "/uav_guidance/state", 10)
    data = uav.navigation.data.guidance_state
    assert data.stale
    seen: list[str] = []
    data.on_change(lambda value: seen.append(value.reference))
    first = data.next()

    def arrived() -> bool:
        publisher.publish(GuidanceState(reference="hover"))
        return first.done

    until(arrived, "a value arrives")
    assert first.value.reference == "hover"
    until(lambda: data.stamp is not None, "its stamp is known")
    sent_s = managers.node.get_clock().now().nanoseconds / 1e9
    publisher.publish(GuidanceState(reference="goto"))
    until(lambda: data.value.reference == "goto", "the next value arrives")
    assert sent_s <= data.stamp <= sent_s + SOON_S
    assert (seen[0], seen[-1]) == ("hover", "goto")
    until(lambda: data.stale, "it grows stale: three periods of 0.2 s")


def test_the_first_value_has_the_stamp_that_the_managers_gave_it(managers, ros2_domain):
    publisher = managers.node.create_publisher(GuidanceState, "/uav_guidance/state", 10)
    until(lambda: publisher.get_subscription_count() > 0, "the managers listen")
    publisher.publish(GuidanceState(reference="hover"))
    sent_s = managers.node.get_clock().now().nanoseconds / 1e9
    period_s = next(data.period_s for data in SKILLSET.data if data.name == "guidance_state")
    too_old_s = sent_s + STALE_PERIODS * period_s
    until(lambda: managers.node.get_clock().now().nanoseconds / 1e9 > too_old_s, "the value has grown stale before a client asks")
    with Uav.connect(domain=ros2_domain, skillsets=NAVIGATION, timeout_s=READY_S) as late:
        data = late.navigation.data.guidance_state
        until(lambda: data.stamp is not None, "the value and its stamp arrive")
        assert data.value.reference == "hover"
        assert abs(data.stamp - sent_s) < too_old_s - sent_s
        assert data.stale


def test_why_says_what_is_missing(uav, managers):
    assert uav.navigation.takeoff.why().get(SOON_S).ready
    managers.bring({"homepoint_status": "INVALID"})
    until(lambda: uav.navigation.homepoint_status.state == "INVALID", "the client knows")
    why = uav.navigation.land.why().get(SOON_S)
    assert (why.ready, [unmet.name for unmet in why.unmet]) == (False, ["in_air"])
    why = uav.navigation.takeoff.why().get(SOON_S)
    assert [(unmet.name, unmet.condition) for unmet in why.unmet] == [("home_valid", "homepoint_status == VALID")]
    assert "homepoint_status is INVALID" in why.reason


def test_two_robots_side_by_side(ros2_domain):
    ones = {name: Managers(namespace=name) for name in ("robot1", "robot2")}
    node = Node(f"skill_runtime_client_{next(NUMBERS)}")
    robots = {name: Uav(node, namespace=f"/{name}") for name in ones}
    spun = Spun(node)
    assert all(robot.wait_ready(READY_S, NAVIGATION) for robot in robots.values())
    handle = robots["robot2"].navigation.takeoff(height=5.0, speed=1.0)
    assert ones["robot2"].running().id == handle.id
    assert ones["robot1"].engine.executions == ()
    assert robots["robot2"].navigation.axes_authority.becomes("USED").get(SOON_S) == "USED"
    assert robots["robot1"].navigation.axes_authority.state == "AVAILABLE"
    handle.interrupt()
    assert handle.get(SOON_S).state is S.INTERRUPTED
    spun.close()
    for managers in ones.values():
        managers.close()


def test_generic_names_that_are_not_there_are_told(managers, ros2_domain):
    with Robot.connect("navigation", domain=ros2_domain, timeout_s=READY_S) as robot:
        navigation = robot["navigation"]
        assert "takeoff" in dir(navigation)
        assert navigation.flight_status.state == "ON_GROUND"
        with pytest.raises(AttributeError, match="no skill or resource 'fly'; it has takeoff, goto"):
            navigation.fly()
        with pytest.raises(AttributeError, match="no data 'fps'; it has guidance_state"):
            navigation.data.fps  # noqa: B018
        with pytest.raises(ValueError, match="speed missing"):
            navigation.takeoff(height=1.0)
        with pytest.raises(KeyError, match="no skillset 'mapping'"):
            robot["mapping"]


def test_managers_that_are_not_there_are_one_error_with_a_remedy(ros2_domain):
    with pytest.raises(NotThereError, match=rf"/robot9/navigation, /robot9/mapping in DDS domain {ros2_domain} within 0.3 s.*panel --list"):
        Robot.connect("navigation", "mapping", namespace="/robot9", domain=ros2_domain, timeout_s=0.3)
    assert not [thread for thread in threading.enumerate() if thread.name == "robot_client_spin"]


@pytest.fixture
def process(ros2_domain):
    program = str(Path(__file__).with_name("skillset_ros2_process.py"))
    served = subprocess.Popen(
        [sys.executable, program, "--ros-args", "-r", "navigation:__ns:=/doomed"], stdout=subprocess.DEVNULL, start_new_session=True
    )
    yield served
    if served.poll() is None:
        os.killpg(served.pid, signal.SIGKILL)
    served.wait(5.0)


def test_every_wait_ends_when_the_managers_are_killed(process, ros2_domain):
    with Uav.connect(namespace="/doomed", domain=ros2_domain, skillsets=NAVIGATION, timeout_s=READY_S) as uav:
        navigation = uav.navigation
        for resource, state in READY_TO_TAKE_OFF.items():
            assert getattr(navigation, resource).transition(state).get(SOON_S).accepted
        handle = navigation.takeoff(height=5.0, speed=1.0)
        until(lambda: handle.state is S.RUNNING, "it runs")
        flying, value = navigation.flight_status.becomes("IN_AIR"), navigation.data.guidance_state.next()
        process.kill()
        asked = navigation.flight_status.transition("IN_AIR")
        reports = list(handle)
        assert (reports[-1].state, handle.get(SOON_S).state) == (S.FAILED, S.FAILED)
        for answer in (flying, value, asked):
            with pytest.raises(NoResponseError, match=r"have gone|did not answer|is not there"):
                answer.get(SOON_S)
        assert navigation.land().get(SOON_S).message == "the managers of navigation are not there"


def test_closing_a_client_ends_its_waits_and_leaves_the_skill_alone(managers, ros2_domain):
    uav = Uav.connect(domain=ros2_domain, skillsets=NAVIGATION, timeout_s=READY_S)
    handle = uav.navigation.takeoff(height=5.0, speed=1.0)
    execution = managers.running()
    waiting = threading.Thread(target=lambda: list(handle))
    waiting.start()
    uav.close()
    uav.close()
    waiting.join(SOON_S)
    assert not waiting.is_alive()
    assert handle.message == "this client was closed"
    assert execution.state is S.RUNNING
    navigation = uav.navigation
    assert navigation.takeoff(height=5.0, speed=1.0).get(SOON_S).state is S.FAILED
    assert (navigation.data.guidance_state.value, navigation.data.guidance_state.stale) == (None, True)
    for answer in (navigation.flight_status.transition("IN_AIR"), navigation.takeoff.why(), navigation.client.interrupt_all("takeoff")):
        with pytest.raises(NoResponseError, match="this client was closed"):
            answer.get(SOON_S)
