"""The reporter on a live graph: at once, until it agrees, again after a restart, without ever blocking the caller."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

rospy = pytest.importorskip("rospy")

from rosgraph_msgs.msg import Clock  # noqa: E402
from skillset_interfaces.msg import ResourceState, ResourceStates  # noqa: E402
from skillset_interfaces.srv import Transition, TransitionRequest, TransitionResponse  # noqa: E402

from alula_testing.waits import HANGS_S, until  # noqa: E402
from resource_reporter import ResourceReporter  # noqa: E402
from resource_reporter.calls import publisher  # noqa: E402

SKILLSET = "reported"
FAILING = """
import rospy
from resource_reporter import ResourceReporter
rospy.init_node("failing")
reporter = ResourceReporter("reported")
reporter.report("zed_status", "OK")
while not reporter._ledger._actual:
    rospy.sleep(0.01)
reporter.when_settled(lambda: {}["of the reporter's thread"])
print("a job waits", flush=True)
rospy.spin()
"""
REPORTING = """
import rospy
from resource_reporter import ResourceReporter
rospy.init_node("reporting")
reporter = ResourceReporter("reported")
reporter.report("zed_status", "OK")
rospy.spin()
"""
ENOUGH_S = 0.1
"""So long another thread gets to add a job, where nothing keeps it."""
ARROWS = {("UNKNOWN", "OK"), ("UNKNOWN", "BROKEN"), ("OK", "BROKEN"), ("BROKEN", "OK")}


class Skillset:
    """A resource manager with one resource."""

    def __init__(self) -> None:
        self.state, self.reason = "UNKNOWN", ""
        self.calls: list[tuple[float, str]] = []
        self.hangs: threading.Event | None = None
        self._lock = threading.Lock()  # one transition at a time, shown in its order, as a real manager does
        self._publisher = rospy.Publisher(f"/{SKILLSET}/resource_states", ResourceStates, queue_size=5, latch=True)
        self._service: object = None
        self.show()

    def serve(self) -> None:
        self._service = rospy.Service(f"/{SKILLSET}/transition", Transition, self._take)

    def restart(self) -> None:
        self._service.shutdown("restart")
        self.state, self.reason = "UNKNOWN", ""
        self.serve()
        self.show()

    def show(self) -> None:
        shown = ResourceState(name="zed_status", state=self.state, reason=self.reason)
        self._publisher.publish(ResourceStates(skillset=SKILLSET, resources=[shown]))

    def close(self) -> None:
        if self._service is not None:
            self._service.shutdown("end")
        self._publisher.unregister()

    def _take(self, request: TransitionRequest) -> TransitionResponse:
        self.calls.append((time.monotonic(), request.to))
        if self.hangs is not None:
            self.hangs.wait(10.0)
        with self._lock:
            if (self.state, request.to) not in ARROWS:
                if self.state == request.to:
                    self.reason = request.reason
                    self.show()
                return TransitionResponse(False, f"no arrow from {self.state} to {request.to}", self.state)
            self.state, self.reason = request.to, request.reason
            self.show()
            return TransitionResponse(True, "", self.state)


@pytest.fixture
def skillset(ros_master: str) -> Iterator[Skillset]:
    skillset = Skillset()
    yield skillset
    skillset.close()


@pytest.fixture
def reporter(ros_master: str) -> Iterator[ResourceReporter]:
    reporter = ResourceReporter(SKILLSET)
    yield reporter
    reporter.close()


def becomes(skillset: Skillset, state: str) -> None:
    until(lambda: skillset.state == state, what=f"the resource is {state}")


def test_reports_within_milliseconds_once_connected(skillset, reporter):
    skillset.serve()
    reporter.report("zed_status", "OK")
    becomes(skillset, "OK")
    latencies, plain = [], []
    direct = rospy.ServiceProxy(f"/{SKILLSET}/transition", Transition, persistent=True)
    for index in range(20):
        state = "BROKEN" if index % 2 == 0 else "OK"
        begin_s = time.monotonic()
        direct("zed_status", "NOWHERE", "")
        plain.append(skillset.calls[-1][0] - begin_s)
        begin_s = time.monotonic()
        reporter.report("zed_status", state)
        returned_s = time.monotonic()
        becomes(skillset, state)
        latencies.append(skillset.calls[-1][0] - begin_s)
        assert returned_s - begin_s < 0.5
    # A quarter of them, beside plain calls: on a busy machine the others tell how long a thread waits for its turn.
    assert sorted(latencies)[5] < 0.004 + 2.0 * sorted(plain)[5]
    assert len(skillset.calls) == 41


def test_its_calls_are_advertised_before_the_first(ros_master):
    publisher.cache_clear()
    reporter = ResourceReporter(SKILLSET)
    assert publisher.cache_info().currsize == 1  # a recorder needs a moment to connect, and would miss the first
    reporter.close()


def test_a_service_that_appears_late_and_a_skillset_that_restarts_are_told(skillset, reporter):
    reporter.report("zed_status", "BROKEN")
    skillset.serve()
    becomes(skillset, "BROKEN")
    skillset.restart()
    becomes(skillset, "BROKEN")


def test_it_is_heard_of_as_long_as_it_lives(ros_master):
    beats: list[ResourceStates] = []
    subscriber = rospy.Subscriber(f"/{SKILLSET}/reported", ResourceStates, beats.append)
    reporter = ResourceReporter(SKILLSET)
    reporter.report("zed_status", "OK")  # nobody takes it, and it is alive all the same
    until(lambda: len(beats) > 2, what="it beats")
    assert {(one.skillset, one.resources[0].name, one.resources[0].state) for one in beats} == {(SKILLSET, "zed_status", "OK")}
    reporter.close()
    until(lambda: not subscriber.get_num_connections(), what="nothing of it is left on the topic")
    subscriber.unregister()


@pytest.fixture
def standing_clock(ros_master: str) -> Iterator[None]:
    """Give nodes that are started now a simulated time that stands."""
    rospy.set_param("/use_sim_time", True)
    clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
    clock.publish(rospy.Time(100))
    yield
    rospy.delete_param("/use_sim_time")
    clock.unregister()


def test_a_simulation_that_stands_is_no_silence(standing_clock, start_node):
    beats: list[ResourceStates] = []
    subscriber = rospy.Subscriber(f"/{SKILLSET}/reported", ResourceStates, beats.append)
    start_node([sys.executable, "-c", REPORTING])
    until(lambda: len(beats) > 3, what="it beats by the monotonic clock")
    assert {one.header.stamp for one in beats} == {rospy.Time(100)}, "the beats are of the mission clock's moment"
    subscriber.unregister()


def test_a_refused_state_does_not_stand_in_the_way_of_the_next(skillset, reporter):
    skillset.serve()
    reporter.report("zed_status", "OK")
    becomes(skillset, "OK")
    reporter.report("zed_status", "UNKNOWN")
    until(lambda: [to for _, to in skillset.calls].count("UNKNOWN") >= 3, what="it is tried again")
    reporter.report("zed_status", "BROKEN")
    becomes(skillset, "BROKEN")


def test_a_hanging_service_blocks_no_caller(skillset, reporter):
    skillset.hangs = threading.Event()
    skillset.serve()
    reporter.report("zed_status", "OK")
    until(lambda: len(skillset.calls) == 1, what="it is called")
    reporter.report("zed_status", "BROKEN")
    assert len(skillset.calls) == 1, "the first call still hangs"
    until(lambda: len(skillset.calls) >= 2, what="it is called again after two seconds")
    skillset.hangs.set()
    becomes(skillset, "BROKEN")


def test_reasons_travel_with_the_states_and_follow_when_they_change(skillset, reporter):
    skillset.serve()
    reporter.report("zed_status", "UNKNOWN", "no images on /left", insist=False)
    until(lambda: skillset.reason == "no images on /left", what="the reason of the first state is shown")
    reporter.report("zed_status", "BROKEN", "the lens is covered")
    becomes(skillset, "BROKEN")
    assert skillset.reason == "the lens is covered"
    reporter.report("zed_status", "BROKEN", "no measurement for 0.35 s")
    until(lambda: skillset.reason == "no measurement for 0.35 s", what="the other reason is shown")
    told = len(skillset.calls)
    reporter.report("zed_status", "OK")
    becomes(skillset, "OK")
    assert (len(skillset.calls), skillset.reason) == (told + 1, "")


def test_what_waits_for_the_skillset_is_done_when_it_has_answered(skillset, reporter):
    done: list[str] = []
    skillset.hangs = threading.Event()
    skillset.serve()
    until(lambda: heard(reporter), what="the states are shown")
    reporter.report("zed_status", "OK")
    reporter.when_settled(lambda: done.append(skillset.state))
    until(lambda: len(skillset.calls) == 1, what="it is asked for")
    assert done == [], "the skillset does not know yet"
    skillset.hangs.set()
    until(lambda: done != [], what="it is done")
    assert done == ["OK"]
    reporter.when_settled(lambda: done.append("at once"))
    assert done == ["OK", "at once"]


class Forgetful(list):
    """Jobs; when they are done and to be forgotten, another one comes."""

    def __init__(self, comes) -> None:
        super().__init__()
        self._comes = threading.Thread(target=comes)
        self._forgotten = threading.Event()

    def clear(self) -> None:
        if not self._forgotten.is_set():
            self._comes.start()
            self._comes.join(ENOUGH_S)
        super().clear()
        self._forgotten.set()

    def come(self) -> None:
        """Return when the other one has come; a call that is under way may outlast ``close``."""
        assert self._forgotten.wait(HANGS_S)
        self._comes.join(HANGS_S)


def test_what_comes_at_the_end_is_done_after_what_has_waited(skillset, reporter):
    reporter.report("zed_status", "OK")  # nothing serves the transition: it is not settled
    until(reporter._subscriber.get_num_connections, "it hears the skillset")
    done: list[str] = []
    jobs = reporter._when_settled = Forgetful(lambda: reporter.when_settled(lambda: done.append("late")))
    reporter.when_settled(lambda: done.append("first"))
    reporter.when_settled(lambda: done.append("second"))
    assert done == []
    reporter.close()
    jobs.come()
    reporter.when_settled(lambda: done.append("closed"))
    assert done == ["first", "second", "late", "closed"]


def test_nothing_waits_for_a_skillset_that_is_not_there(reporter):
    done: list[str] = []
    reporter.report("zed_status", "OK")
    reporter.when_settled(lambda: done.append("done"))
    assert done == ["done"]


def test_what_waits_for_a_skillset_that_has_gone_is_done(skillset, reporter):
    done: list[str] = []
    until(lambda: heard(reporter), what="the states are shown")
    reporter.report("zed_status", "OK")  # nobody serves it
    reporter.when_settled(lambda: done.append("done"))
    assert done == []
    skillset.close()
    until(lambda: done == ["done"], what="it is done")


def test_an_error_in_the_reporters_thread_ends_the_node(skillset, ros_master):
    skillset.hangs = threading.Event()
    skillset.serve()
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": {**os.environ, "ROS_MASTER_URI": ros_master}}
    with subprocess.Popen([sys.executable, "-c", FAILING], text=True, **pipes) as node:
        assert node.stdout.readline() == "a job waits\n"
        skillset.hangs.set()
        _, said = node.communicate(timeout=HANGS_S)
    assert node.returncode == 1, said
    assert "an error in the thread report_reported ends this node" in said
    assert 'KeyError: "of the reporter\'s thread"' in said


def heard(reporter: ResourceReporter) -> bool:
    """Return whether the reporter has heard the skillset: from then on it waits for it. rospy counts a connection before it is made."""
    return bool(reporter._ledger._actual)
