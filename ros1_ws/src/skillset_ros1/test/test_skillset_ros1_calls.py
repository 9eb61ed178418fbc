"""Many calls of one service at once, on a live ROS 1 graph."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest
import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from alula_testing.waits import until
from skillset_ros1.calls import WINDOW, ServiceCallError, call, call_and_wait

SOON_S = 30.0


class Service:
    """A service that counts how many of its requests are under way."""

    def __init__(self, name: str, act: Callable[[], object]) -> None:
        self.name, self._act = name, act
        self._lock = threading.Lock()
        self.taken, self.under_way, self.most = 0, 0, 0
        self._service = rospy.Service(name, SetBool, self._serve)
        self.close = self._service.shutdown

    def _serve(self, request: SetBoolRequest) -> SetBoolResponse:
        with self._lock:
            self.taken, self.under_way = self.taken + 1, self.under_way + 1
            self.most = max(self.most, self.under_way)
        self._act()
        with self._lock:
            self.under_way -= 1
        return SetBoolResponse(success=request.data)

    def ask(self, times: int, timeout_s: float) -> list[object]:
        """Call at once so many times; return the list that the replies and errors come into."""
        ends: list[object] = []
        for _ in range(times):
            call(self.name, SetBool, SetBoolRequest(data=True), lambda reply: ends.append(reply.success), ends.append, timeout_s=timeout_s)
        return ends


@pytest.fixture
def serve(ros_master) -> Iterator[Callable[[str, Callable[[], object]], Service]]:
    services: list[Service] = []

    def start(name: str, act: Callable[[], object]) -> Service:
        services.append(Service(name, act))
        return services[-1]

    yield start
    for service in services:
        service.close()


def test_no_more_than_a_window_of_calls_is_under_way_and_each_has_its_time_from_its_turn_on(serve):
    service = serve("/calls/slow", lambda: time.sleep(1.0))
    calls = 4 * WINDOW
    ends = service.ask(calls, timeout_s=3.0)  # the last ones have their turn after 3 s
    until(lambda: len(ends) == calls, "each call ends", SOON_S)
    assert ends == [True] * calls
    assert service.most == WINDOW


def test_a_service_that_hangs_is_not_called_by_what_has_waited_too_long(serve):
    go_on = threading.Event()
    service = serve("/calls/hung", lambda: go_on.wait(SOON_S))
    first = service.ask(WINDOW, timeout_s=4.0)
    until(lambda: service.taken == WINDOW, "the service hangs", SOON_S)
    waiting = service.ask(2 * WINDOW, timeout_s=1.0)
    until(lambda: len(first + waiting) == 3 * WINDOW, "each call ends", SOON_S)
    assert first == ["service /calls/hung did not answer within 4 s"] * WINDOW
    assert waiting == ["service /calls/hung did not answer within 1 s"] * 2 * WINDOW
    assert service.taken == WINDOW
    go_on.set()
    again = service.ask(1, timeout_s=SOON_S)
    until(lambda: again, "the next call ends", SOON_S)
    assert again == [True]


def test_a_callback_that_takes_its_time_holds_up_no_call(serve):
    service = serve("/calls/quick", lambda: None)
    go_on, ends = threading.Event(), []
    for _ in range(3 * WINDOW):
        call(
            service.name,
            SetBool,
            SetBoolRequest(data=True),
            lambda reply: ends.append(reply.success) or go_on.wait(SOON_S),
            ends.append,
            timeout_s=SOON_S,
        )
    until(lambda: len(ends) == 3 * WINDOW, "each call is answered", SOON_S)
    go_on.set()
    assert all(ends)


LIMIT_S = 3.0
CALLER = f"""
import rospy
from std_srvs.srv import SetBool, SetBoolRequest
from skillset_ros1.calls import call_and_wait

rospy.init_node("caller", anonymous=True)
print(call_and_wait("/calls/stops", SetBool, SetBoolRequest(data=True), timeout_s={LIMIT_S}).success)
"""


def test_time_in_which_the_process_could_not_run_does_not_count(serve):
    asked = threading.Event()
    go_on = threading.Event()
    serve("/calls/stops", lambda: asked.set() or go_on.wait(SOON_S))
    with subprocess.Popen([sys.executable, "-c", CALLER], stdout=subprocess.PIPE, text=True) as caller:
        assert asked.wait(SOON_S)
        os.kill(caller.pid, signal.SIGSTOP)
        time.sleep(1.1 * LIMIT_S)
        os.kill(caller.pid, signal.SIGCONT)
        go_on.set()
        assert caller.communicate(timeout=SOON_S)[0] == "True\n"


def test_a_service_that_is_not_there_is_told_so(ros_master):
    with pytest.raises(ServiceCallError, match=r"service /calls/nobody is not there within 0\.3 s"):
        call_and_wait("/calls/nobody", SetBool, SetBoolRequest(), timeout_s=0.3)
