"""A play of mocks on ROS 2: real skillset nodes, the node's clock, and the functional layer's topics."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.node import Node
from skillset_interfaces.msg import Event

from skill_runtime.plain import message_class
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.data_manager import DataBindings
from skill_runtime.ros2.due import DueTimer
from skill_runtime.ros2.manager_node import SkillsetNode
from skill_runtime.ros2.names import EVENTS

Job = Callable[[], None]


class Appointment:
    """A job that waits for its moment."""

    def __init__(self, job: Job) -> None:
        self._job: Job | None = job

    def cancel(self) -> None:
        """Let the job not happen."""
        self._job = None

    def keep(self) -> None:
        """Do the job, unless it was cancelled."""
        job, self._job = self._job, None
        if job is not None:
            job()


class Agenda:
    """Jobs in the order of their moments, put in from any thread and done in that of ``tick``."""

    def __init__(self, now_ns: Callable[[], int], note: Callable[[str], None]) -> None:
        self._now_ns = now_ns
        self._note = note
        self._lock = threading.Lock()
        self._numbers = itertools.count()
        self._jobs: list[tuple[int, int, Appointment]] = []

    @property
    def due_ns(self) -> int | None:
        """When the first job is due."""
        with self._lock:
            return self._jobs[0][0] if self._jobs else None

    def put(self, when_ns: int, job: Job) -> Appointment:
        """Have a job done at a moment."""
        appointment = Appointment(job)
        with self._lock:
            heapq.heappush(self._jobs, (when_ns, next(self._numbers), appointment))
        return appointment

    def tick(self) -> None:
        """Do what is due; a job that raises is told and ends nothing but itself."""
        while (appointment := self._pop()) is not None:
            try:
                appointment.keep()
            except Exception as error:  # noqa: BLE001 - the play goes on
                self._note(f"{type(error).__name__}: {error}")

    def _pop(self) -> Appointment | None:
        with self._lock:
            if not self._jobs or self._jobs[0][0] > self._now_ns():
                return None
            return heapq.heappop(self._jobs)[2]


class RosStage:
    """The stage that a node is; ``nodes`` (the mocked skillsets) are added once they are made."""

    def __init__(self, node: Node, bindings: Mapping[str, DataBindings]) -> None:
        self.nodes: dict[str, SkillsetNode] = {}
        self.notes: list[str] = []
        self._node = node
        self._bindings = bindings
        self._publishers: dict[tuple[str, str], Any] = {}
        self._agenda = Agenda(self._now_ns, self.note)
        self._timer = DueTimer(node, self._agenda)

    def watch(self, skillsets: Sequence[str], on_state: Callable[[str, str, str], None]) -> None:
        """Have ``on_state(skillset, resource, state)`` called for every transition."""

        def follow(event: Any) -> None:
            if event.kind == Event.TRANSITION:
                on_state(event.skillset, event.resource, event.to_state)

        for name in skillsets:
            self._node.create_subscription(Event, f"{name}/events", follow, EVENTS)

    @property
    def now_s(self) -> float:
        """Mission clock."""
        return self._now_ns() / 1e9

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def after(self, delay_s: float, job: Job) -> Appointment:
        """Have a job done after a delay of mission clock."""
        appointment = self._agenda.put(self._now_ns() + round(delay_s * 1e9), job)
        self._timer.look()
        return appointment

    def transition(self, skillset: str, resource: str, to: str) -> str:
        """Take an extern transition."""
        node = self.nodes.get(skillset)
        return f"{skillset} is not mocked here" if node is None else node.engine.transition(resource, to).reason

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource."""
        node = self.nodes.get(skillset)
        return "" if node is None else node.engine.resources[resource].state

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Publish a value where the functional layer would; a header gets the present stamp."""
        topic, type_name = self._bindings[skillset][data]
        message = message_class(type_name)()
        values = value if isinstance(value, Mapping) else {"data": value}
        try:
            fill(message, values, f"the mock's {skillset}.{data}")
        except ValueError as error:
            self.note(str(error))
            return
        if "header" in fields_of(message) and "header" not in values:
            message.header.stamp = self._node.get_clock().now().to_msg()
        if (skillset, data) not in self._publishers:
            self._publishers[skillset, data] = self._node.create_publisher(type(message), topic, 10)
        self._publishers[skillset, data].publish(message)

    def note(self, error: str) -> None:
        """Say what went wrong."""
        if error not in self.notes:
            self.notes.append(error)
            self._node.get_logger().error(error)
