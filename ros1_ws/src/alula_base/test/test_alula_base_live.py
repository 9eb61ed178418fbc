"""The dead man on a live graph: a heartbeat's process is stopped or killed, and what the owner named is called."""

from __future__ import annotations

import itertools
import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

rospy = pytest.importorskip("rospy")

import actionlib  # noqa: E402
import actionlib.msg  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from skillset_interfaces.msg import ResourceState, ResourceStates  # noqa: E402
from skillset_interfaces.srv import Transition, TransitionRequest, TransitionResponse  # noqa: E402
from std_msgs.msg import Header, String  # noqa: E402
from std_srvs.srv import SetBool, SetBoolResponse  # noqa: E402

from alula_testing.ros1 import refusal_of_node  # noqa: E402
from alula_testing.waits import HANGS_S, until  # noqa: E402

NODE = [sys.executable, str(Path(__file__).parents[1] / "scripts/dead_man")]
HEART = """
import rospy, sys
from std_msgs.msg import Header
rospy.init_node("heart", anonymous=True)
publisher = rospy.Publisher("/decision/alive", Header, queue_size=1)
while not rospy.is_shutdown():
    publisher.publish(Header())
    rospy.sleep(0.1)
"""
SILENT_AFTER_S = 3.0
"""Longer than a busy machine lets a heart wait."""
NUMBERS = itertools.count(1)


class Robot:
    """The robot's own nodes, and what they are told."""

    def __init__(self, namespace: str, mark: Path) -> None:
        self.name, self.mark = namespace, mark
        self.node = f"{namespace}/alula_base"
        self.states: list[dict] = []
        self.told: list[str] = []
        self.hangs: threading.Event | None = None
        self.refusals = 0
        self.heart: Callable = lambda: None
        self._state = rospy.Subscriber(f"{self.node}/state", String, lambda message: self.states.append(json.loads(message.data)))
        self._wheels = rospy.Subscriber(f"{namespace}/cmd_vel", Twist, self._turn)
        self._brake = rospy.Service(f"{namespace}/brake", SetBool, self._brake_set)
        self.server = actionlib.SimpleActionServer(f"{namespace}/move", actionlib.msg.TestAction, self._move, auto_start=False)
        self.server.start()

    def _turn(self, twist: Twist) -> None:
        self.told.append("zero" if twist == Twist() else "motion")

    def _brake_set(self, request: object) -> SetBoolResponse:
        if self.hangs is not None:
            self.hangs.wait(HANGS_S)
        self.told.append(f"brake {request.data}")
        self.refusals -= 1
        return SetBoolResponse(self.refusals < 0, "not yet")

    def _move(self, _goal: actionlib.msg.TestGoal) -> None:
        until(lambda: self.server.is_preempt_requested() or rospy.is_shutdown(), what="the goal is cancelled")
        self.told.append("cancelled")
        self.server.set_preempted()

    def until_state(self, **values: object) -> dict:
        def fits() -> bool:
            return bool(self.states) and all(self.states[-1][name] == value for name, value in values.items())

        until(fits, what=f"the dead man's state has {values}")
        return self.states[-1]

    def until_called(self) -> dict:
        until(lambda: all(call["done"] is not None for call in self.states[-1]["calls"].values()), what="all calls are made")
        return self.states[-1]["calls"]

    def configure(self, **more: object) -> None:
        calls = {
            "wheels": {"zero": f"{self.name}/cmd_vel", "rate_hz": 50.0, "for_s": 0.2},
            "brake": {"service": f"{self.name}/brake", "type": "std_srvs/SetBool", "request": {"data": True}, "within_s": HANGS_S},
            "navigation": {"cancel": f"{self.name}/move", "within_s": HANGS_S},
            "mark": {"script": [sys.executable, "-c", f"open({str(self.mark)!r}, 'a').write('stopped ')"]},
        }
        rospy.set_param(self.node, {"heartbeats": ["/decision/alive"], "silent_after_s": SILENT_AFTER_S, "stop": calls, **more})

    def close(self) -> None:
        for part in (self._state, self._wheels):
            part.unregister()
        self._brake.shutdown("end")


@pytest.fixture
def robot(ros_master: str, tmp_path: Path) -> Iterator[Robot]:
    robot = Robot(f"/robot{next(NUMBERS)}", tmp_path / "mark")
    yield robot
    robot.close()


@pytest.fixture
def start_dead_man(robot: Robot, start_node) -> Callable:
    def start():
        return start_node([*NODE, f"__ns:={robot.name}"])

    return start


@pytest.fixture
def start_heart(start_node) -> Callable:
    return lambda: start_node([sys.executable, "-c", HEART])


def test_it_stops_the_robot_when_the_heartbeat_is_suspended_and_when_it_is_killed(robot, start_dead_man, start_heart):
    robot.configure()
    start_dead_man()
    state = robot.until_state(state="unheard")
    assert (state["stops"], state["calls"]["brake"]["done"]) == (0, None)
    goal = actionlib.SimpleActionClient(f"{robot.name}/move", actionlib.msg.TestAction)
    goal.wait_for_server()
    goal.send_goal(actionlib.msg.TestGoal())
    until(robot.server.is_active, what="the robot is under way")
    heart = start_heart()
    assert robot.until_state(state="heard")["stops"] == 0
    assert robot.told == [], "it hears, and calls nothing"
    heart.send_signal(signal.SIGSTOP)
    robot.until_state(state="silent", stops=1)
    calls = robot.until_called()
    assert {name: call["done"] for name, call in calls.items()} == dict.fromkeys(calls, True)
    assert calls["brake"]["said"] == f"{robot.name}/brake has answered"
    assert calls["navigation"]["said"] == f"{robot.name}/move has no goal any more"
    assert {*robot.told} == {"zero", "brake True", "cancelled"}
    assert robot.told.count("brake True") == robot.told.count("cancelled") == 1
    assert robot.mark.read_text() == "stopped "
    heart.send_signal(signal.SIGCONT)
    robot.until_state(state="heard", stops=1)
    told = len(robot.told)
    heart.kill()
    robot.until_state(state="silent", stops=2)
    until(lambda: "brake True" in robot.told[told:] and "zero" in robot.told[told:], what="it is stopped again")
    assert "motion" not in robot.told, "nothing is started by itself"
    until(lambda: robot.mark.read_text() == "stopped stopped ", what="the script has run again")


def test_what_hangs_delays_nothing_else_and_what_refuses_is_asked_again(robot, start_dead_man, start_heart):
    robot.configure()
    rospy.set_param(f"{robot.node}/stop/brake/within_s", 1.0)
    robot.hangs = threading.Event()
    robot.refusals = 2
    start_dead_man()
    robot.until_state(state="unheard")
    heart = start_heart()
    robot.until_state(state="heard")
    heart.kill()
    robot.until_state(state="silent")
    until(lambda: "zero" in robot.told and robot.mark.exists(), what="the others are called")
    calls = robot.until_called()
    assert (calls["brake"]["done"], calls["wheels"]["done"]) == (False, True)
    assert calls["brake"]["said"].startswith(f"{robot.name}/brake did not answer within 1 s")
    robot.hangs.set()
    until(lambda: robot.told.count("brake True") == 1, what="it went on hanging")
    rospy.set_param(f"{robot.node}/stop/brake/within_s", HANGS_S)
    rospy.set_param(f"{robot.node}/stop/nobody", {"zero": f"{robot.name}/nobody", "for_s": 0.1})
    rospy.set_param(f"{robot.node}/stop/breaks", {"script": ["false"]})
    rospy.set_param(f"{robot.node}/stop/long", {"script": ["sleep", "600"], "within_s": 0.2})
    start_dead_man()  # the first one ends, for it has the name
    robot.until_state(state="unheard", stops=0)
    heart = start_heart()
    robot.until_state(state="heard")
    heart.kill()
    robot.until_state(state="silent")
    calls = robot.until_called()
    assert calls["brake"]["done"], "it has refused once, and was asked again"
    assert robot.told.count("brake True") == 3
    assert (calls["nobody"]["done"], calls["nobody"]["said"]) == (False, f"nobody listens on {robot.name}/nobody")
    assert (calls["breaks"]["done"], calls["breaks"]["said"]) == (False, "false has ended with 1")
    assert (calls["long"]["done"], calls["long"]["said"]) == (False, "sleep was killed after 0.2 s")


def test_a_second_step_is_called_only_where_the_silence_lasts(robot, start_dead_man, start_heart):
    first = {"zero": f"{robot.name}/cmd_vel", "rate_hz": 50.0, "for_s": 0.2}
    second = {"service": f"{robot.name}/brake", "type": "std_srvs/SetBool", "request": {"data": True}, "after_s": SILENT_AFTER_S}
    robot.configure(stop={"hover": first, "land": second})
    start_dead_man()
    heart = start_heart()
    robot.until_state(state="heard")
    heart.send_signal(signal.SIGSTOP)
    robot.until_state(state="silent")
    until(lambda: robot.states[-1]["calls"]["hover"]["done"], what="it hovers")
    heart.send_signal(signal.SIGCONT)
    not_called = f"was not called: heard again within {SILENT_AFTER_S:g} s"
    until(lambda: robot.states[-1]["calls"]["land"]["said"] == not_called, what="it is said that it need not land")
    assert robot.told.count("brake True") == 0
    heart.kill()
    silent_s = rospy.get_time()
    until(lambda: robot.states[-1]["calls"]["land"]["done"], what="it lands")
    assert robot.states[-1]["calls"]["hover"]["done"]
    assert robot.states[-1]["stops"] == 2
    assert rospy.get_time() - silent_s >= 2 * SILENT_AFTER_S - 1.0, "s: of silence, then of hovering; the heart beats every 0.1 s"


@pytest.fixture
def simulated(ros_master: str) -> Iterator[Callable[[float], None]]:
    """Give nodes that are started now simulated time; yield what sets it, seconds."""
    rospy.set_param("/use_sim_time", True)
    clock = rospy.Publisher("/clock", Clock, queue_size=10, latch=True)
    yield lambda now_s: clock.publish(rospy.Time.from_sec(now_s))
    rospy.delete_param("/use_sim_time")
    clock.unregister()


def test_in_simulation_a_silence_lasts_on_both_clocks(robot, start_dead_man, simulated):
    simulated(100.0)
    robot.configure(silent_after_s=1.0)
    start_dead_man()
    heart = rospy.Publisher("/decision/alive", Header, queue_size=1, latch=True)
    heart.publish(Header())
    robot.until_state(state="heard")
    begin_s = time.monotonic()

    def is_silent() -> bool:
        simulated(100.0 + (time.monotonic() - begin_s) / 3)
        return robot.states[-1]["state"] == "silent"

    until(is_silent, what="it is silent")
    assert robot.states[-1]["stops"] == 1
    assert time.monotonic() - begin_s >= 3.0, "s: of a simulation that takes three for one"
    heart.unregister()


class Skillset:
    """A resource manager with one resource, that can be out of reach."""

    ARROWS = (("UNKNOWN", "UP"), ("UNKNOWN", "DOWN"), ("UP", "DOWN"), ("DOWN", "UP"))

    def __init__(self, name: str) -> None:
        self.name, self.state, self.in_reach = name, "UNKNOWN", True
        self.history: list[tuple[str, str]] = []
        self._publisher = rospy.Publisher(f"/{name}/resource_states", ResourceStates, queue_size=5, latch=True)
        self._service = rospy.Service(f"/{name}/transition", Transition, self._take)
        self._show()

    def close(self) -> None:
        self._service.shutdown("end")
        self._publisher.unregister()

    def _show(self) -> None:
        self._publisher.publish(ResourceStates(skillset=self.name, resources=[ResourceState(name="link", state=self.state)]))

    def _take(self, request: TransitionRequest) -> TransitionResponse:
        if not self.in_reach:
            raise ConnectionError("the link is down")
        accepted = (self.state, request.to) in self.ARROWS
        if accepted:
            self.state = request.to
            self.history.append((request.to, request.reason))
        self._show()
        return TransitionResponse(accepted, "" if accepted else "no arrow", self.state)


def test_a_skillset_learns_of_a_silence_that_is_over_before_it_could_be_told(robot, start_dead_man, start_heart):
    skillset = Skillset(robot.name[1:])
    robot.configure(report={"skillset": skillset.name, "resource": "link", "heard": "UP", "silent": "DOWN"})
    start_dead_man()
    heart = start_heart()
    until(lambda: skillset.state == "UP", what="it is told that all is heard")
    skillset.in_reach = False
    heart.send_signal(signal.SIGSTOP)
    robot.until_state(state="silent")
    heart.send_signal(signal.SIGCONT)
    robot.until_state(state="heard", stops=1)
    assert [state for state, _ in skillset.history] == ["UP"]
    skillset.in_reach = True
    until(lambda: len(skillset.history) >= 3, what="it is told of the silence, and of its end")
    assert [state for state, _ in skillset.history] == ["UP", "DOWN", "UP"]
    assert skillset.history[1][1].startswith("nothing heard of /decision/alive for ")
    skillset.close()


@pytest.mark.parametrize(
    ("stop", "told"),
    [
        ({"a": {"service": "/a", "type": "no_such/Type"}}, "~stop/a/type: there is no service type no_such/Type here"),
        ({"a": {"service": "/a", "type": "std_srvs/SetBool", "request": {"date": True}}}, "~stop/a/request does not fit std_srvs/SetBool"),
        ({"a": {"service": "/a", "type": "std_srvs/SetBool", "request": {"data": "yes"}}}, "~stop/a/request does not fit std_srvs/SetBool"),
        ({"a": {"script": ["no-such-program"]}}, "~stop/a/script: there is no program no-such-program"),
        ({}, "~stop is empty"),
    ],
)
def test_what_can_not_be_called_is_refused_at_the_start(robot, ros_master, stop, told):
    robot.configure()
    rospy.delete_param(f"{robot.node}/stop")
    rospy.set_param(f"{robot.node}/stop", stop)
    assert told in refusal_of_node([*NODE, f"__ns:={robot.name}"], ros_master)
