"""The asking sides: a skillset's client, and a bare action client with a bare subscription. Times are milliseconds of wall clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.time import Time
from skillset_interfaces.msg import Event

from alula.model.execution_state import ExecutionState
from alula.runtime.core.events import EngineEvent, TransitionEvent
from skill_bench.cases import FREE, INPUT, LOST, Case, make_skillset, resource_name, skill_name
from skill_bench.processes import follow
from skill_bench.servers import ACTION, BARE_ACTION, BARE_TOPIC, make_interfaces
from skillset_ros2 import ActionClient, SkillHandle, SkillsetClient
from skillset_ros2.names import EVENTS
from skillset_ros2.session import Session

LIMIT_S = 10.0
READY_S = 45.0
REST_S = 0.03
"""Between two measurements: longer than the managers wait with their ``skill_states`` (0.02 s)."""
NS_PER_MS = 1e6
Samples = dict[str, list[float]]


def follow_skills(connection: Connection, case: Case) -> None:
    """Be the client of a case's skillset."""
    make_interfaces(make_skillset(case))
    session = Session("bench_client")
    requests = SkillRequests(session.node, case)
    follow(connection, {"ready": requests.ready, "stop": requests.stop, "lose": requests.lose})
    session.close()


def follow_bare(connection: Connection, _: object) -> None:
    """Be the client of the bare action and topic."""
    session = Session("bench_bare_client", executor=SingleThreadedExecutor)
    requests = BareRequests(session.node)
    follow(connection, {"ready": requests.ready, "goals": requests.goals, "topic": requests.topic})
    session.close()


class States:
    """When a handle was in which state first, as the thread has it that spins the client."""

    def __init__(self, handle: SkillHandle) -> None:
        self.handle = handle
        self.seen_ns: dict[ExecutionState, int] = {}
        self._news = threading.Condition()
        handle.on_report(lambda report: self._note(report.state))
        # It may have been reported before it was listened to.
        self._note(handle.state)

    def _note(self, state: ExecutionState) -> None:
        now_ns = time.monotonic_ns()
        with self._news:
            self.seen_ns.setdefault(state, now_ns)
            self._news.notify_all()

    def wait(self, state: ExecutionState) -> int:
        """Return when (monotonic) the state was entered; raise TimeoutError when it is not within the limit."""
        with self._news:
            if not self._news.wait_for(lambda: state in self.seen_ns, LIMIT_S):
                raise TimeoutError(f"not {state.value} within {LIMIT_S:g} s: {self.handle} {self.handle.message}")
            return self.seen_ns[state]


class SkillRequests:
    """Starts, stops and loses the skills of a case in turn."""

    def __init__(self, node: Any, case: Case) -> None:
        self._now_ns: Callable[[], int] = lambda: int(node.get_clock().now().nanoseconds)
        self._case = case
        self._turn = 0
        self._lost_ns: dict[str, int] = {}
        self._told_ns: dict[str, int] = {}
        self._news = threading.Condition()
        self._client = SkillsetClient(node, case.skillset)
        self._client.on_event(self._hear)

    def ready(self) -> None:
        """Wait until the managers can be called."""
        if not self._client.wait_ready(READY_S):
            raise TimeoutError(f"the managers were not ready within {READY_S:g} s")

    def stop(self, number: int) -> Samples:
        """Request and interrupt skills: from ``start`` to RUNNING, from ``interrupt`` to INTERRUPTED."""
        samples: Samples = {"request_ms": [], "interrupt_ms": []}
        for _ in range(number):
            _, states = self._run(samples["request_ms"])
            asked_ns = time.monotonic_ns()
            states.handle.interrupt()
            samples["interrupt_ms"].append((states.wait(ExecutionState.INTERRUPTED) - asked_ns) / NS_PER_MS)
            time.sleep(REST_S)
        return samples

    def lose(self, number: int) -> Samples:
        """Have skills' invariants broken by extern transitions.

        ``violation_ms`` is from the transition, as its event is stamped, to the handle's end; ``told_ms`` to the event of the
        execution's end; ``asked_ms`` from the call of the transition's service to the handle's end.
        """
        samples: Samples = {"request_ms": [], "violation_ms": [], "told_ms": [], "asked_ms": []}
        for _ in range(number):
            index, states = self._run(samples["request_ms"])
            resource = resource_name(index)
            asked_ns = time.monotonic_ns()
            answer = self._client.transition(resource, LOST)
            seen_ns = states.wait(ExecutionState.RESOURCE_INVARIANT_VIOLATED)
            answer.get(LIMIT_S)
            # The stamp is of ROS time; what has passed since is subtracted to have the moment of the end in ROS time, too.
            ended_ns = self._now_ns() - (time.monotonic_ns() - seen_ns)
            lost_ns = self._heard(self._lost_ns, resource)
            samples["violation_ms"].append((ended_ns - lost_ns) / NS_PER_MS)
            samples["told_ms"].append((self._heard(self._told_ns, states.handle.id) - lost_ns) / NS_PER_MS)
            samples["asked_ms"].append((seen_ns - asked_ns) / NS_PER_MS)
            if not self._client.transition(resource, FREE).get(LIMIT_S).accepted:
                raise RuntimeError(f"{resource} was not found again")
            time.sleep(REST_S)
        return samples

    def _run(self, request_ms: list[float]) -> tuple[int, States]:
        """Have the next skill running; return its index."""
        index, self._turn = self._turn % self._case.skills, self._turn + 1
        asked_ns = time.monotonic_ns()
        states = States(self._client.start(skill_name(index), **{INPUT: 1.0}))
        request_ms.append((states.wait(ExecutionState.RUNNING) - asked_ns) / NS_PER_MS)
        return index, states

    def _hear(self, event: EngineEvent) -> None:
        with self._news:
            if isinstance(event, TransitionEvent):
                if event.to_state == LOST:
                    self._lost_ns[event.resource] = event.stamp_ns
            elif event.state is ExecutionState.RESOURCE_INVARIANT_VIOLATED:
                self._told_ns[event.id] = self._now_ns()
            self._news.notify_all()

    def _heard(self, times_ns: dict[str, int], name: str) -> int:
        """Take the time of an event, which may come after the result that tells of the same."""
        with self._news:
            if not self._news.wait_for(lambda: name in times_ns, LIMIT_S):
                raise TimeoutError(f"no event of {name} within {LIMIT_S:g} s")
            return times_ns.pop(name)


class BareRequests:
    """Sends bare goals and hears a bare topic."""

    def __init__(self, node: Any) -> None:
        self._clock = node.get_clock()
        self._actions = ActionClient(node, ACTION, BARE_ACTION)
        self._delays_ms: list[float] = []
        self._news = threading.Condition()
        node.create_subscription(Event, BARE_TOPIC, self._hear, EVENTS)

    def ready(self) -> None:
        """Wait until the action is there."""
        if not self._actions.wait_for_server(READY_S):
            raise TimeoutError(f"{BARE_ACTION} was not there within {READY_S:g} s")

    def goals(self, number: int) -> Samples:
        """Send goals: from the sending to the accepting answer; the result is waited for, so that no goal meets another."""
        return {"goal_ms": [self._goal() for _ in range(number)]}

    def topic(self, number: int) -> Samples:
        """Hear so many messages: from the publisher's stamp to the callback."""
        with self._news:
            if not self._news.wait_for(lambda: len(self._delays_ms) >= number, LIMIT_S):
                raise TimeoutError(f"{len(self._delays_ms)} of {number} messages within {LIMIT_S:g} s")
            samples, self._delays_ms = self._delays_ms, []
        return {"topic_ms": samples}

    def _goal(self) -> float:
        accepted_ns: list[int] = []
        ended = threading.Event()

        def on_answer(answer: Any) -> None:
            accepted_ns.append(time.monotonic_ns())
            answer.result().get_result_async().add_done_callback(lambda _: ended.set())

        sent_ns = time.monotonic_ns()
        self._actions.send_goal_async(ACTION.Goal(**{INPUT: 1.0})).add_done_callback(on_answer)
        if not ended.wait(LIMIT_S):
            raise TimeoutError(f"a bare goal did not end within {LIMIT_S:g} s")
        time.sleep(REST_S)
        return (accepted_ns[0] - sent_ns) / NS_PER_MS

    def _hear(self, message: Any) -> None:
        delay_ns = self._clock.now().nanoseconds - Time.from_msg(message.header.stamp).nanoseconds
        with self._news:
            self._delays_ms.append(delay_ns / NS_PER_MS)
            self._news.notify_all()
