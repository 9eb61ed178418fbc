"""What the perception nodes use of rospy, without a graph, without threads and in virtual time: the same messages make the same messages.

``install`` puts it in place of rospy's own; the nodes themselves are those that fly.
"""

from __future__ import annotations

import heapq
import itertools
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import genpy
import rospy
from std_msgs.msg import String

Item = TypeVar("Item")
Publish = Callable[[str, Any], None]
WORK_S = 0.1
"""How long a node takes for a measurement: by then the poses up to its end are there, as they are in flight."""
CALLS = "/calls"


class Graph:
    """The subscribers, the services, and what is to be done when.

    Args:
        publish: gets whatever is published, ``publish(topic, message)``.
    """

    def __init__(self, publish: Publish) -> None:
        self.now_ns = 0
        self.publish = publish
        self.subscribers: dict[str, list[tuple[Any, Callable[[Any], None]]]] = {}
        self.services: dict[str, tuple[Any, Callable[[Any], Any]]] = {}
        self.parameters: Mapping[str, Mapping[str, object]] = {}
        self._node = ""
        self._jobs: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = itertools.count()

    @contextmanager
    def node(self, name: str) -> Iterator[None]:
        """Have names with ``~`` be those of a node while it is made."""
        self._node = name
        yield
        self._node = ""

    def resolve(self, name: str) -> str:
        """Return the name with the node's namespace where it begins with ``~``."""
        return f"/{self._node}/{name[1:]}" if name.startswith("~") else name

    def own_parameters(self) -> dict[str, object]:
        """Return the private parameters of the node that is being made."""
        return dict(self.parameters.get(self._node, {}))

    def after(self, delay_s: float, job: Callable[[], None]) -> None:
        """Have a job done after a while."""
        heapq.heappush(self._jobs, (self.now_ns + round(delay_s * 1e9), next(self._numbers), job))

    def advance_to(self, stamp_ns: int) -> None:
        """Let time pass, and do what is due."""
        while self._jobs and self._jobs[0][0] <= stamp_ns:
            self.now_ns, _, job = heapq.heappop(self._jobs)
            job()
        self.now_ns = max(self.now_ns, stamp_ns)

    def deliver(self, topic: str, kind: str, data: bytes) -> None:
        """Give a message, as it is on the wire, to all of the topic's subscribers."""
        for wanted, callback in self.subscribers.get(topic, ()):
            if wanted is rospy.AnyMsg:
                raw = rospy.AnyMsg()
                raw._buff, raw._connection_header = data, {"type": kind}  # noqa: SLF001 - as rospy itself does
                callback(raw)
            else:
                callback(wanted().deserialize(data))

    def call(self, service: str, request: Mapping[str, Any]) -> bool:
        """Repeat a recorded call of a service; return whether a node here serves it."""
        served = self.services.get(service)
        if served is None:
            return False
        kind, handler = served
        handler(kind._request_class(**request))  # noqa: SLF001 - genpy's way to tell
        return True


class OfflinePublisher:
    """A topic's writing end. A node that asks is told of no subscriber: what is made for subscribers alone is not made."""

    def __init__(self, graph: Graph, name: str) -> None:
        self._graph = graph
        self._topic = graph.resolve(name)

    def publish(self, message: Any) -> None:
        """Give the message to all subscribers of the topic, on this thread."""
        self._graph.publish(self._topic, message)

    def get_num_connections(self) -> int:
        """Return 0: nothing is to be made for subscribers alone."""
        return 0


class OfflineSubscription:
    """A topic's reading end; the bag stands for the driver that publishes there."""

    def get_num_connections(self) -> int:
        """Return 1: the bag."""
        return 1


class OfflineService:
    """Registers a service's handler in the graph, for calls of this process."""

    def __init__(self, graph: Graph, name: str, kind: Any, handler: Callable[[Any], Any]) -> None:
        self.resolved_name = graph.resolve(name)
        graph.services[self.resolved_name] = kind, handler


class OfflineWorker(Generic[Item]):
    """Works on the newest item, ``WORK_S`` after it was offered; what was offered meanwhile waits, and only the newest of that."""

    graph: Graph

    def __init__(self, work: Callable[[Item], None]) -> None:
        self._work = work
        self._waiting: list[Item] = []
        self._busy = False

    def offer(self, item: Item) -> None:
        """Replace what waits by this item."""
        self._waiting = [item]
        if not self._busy:
            self._begin()

    def _begin(self) -> None:
        if self._waiting:
            self._busy, item = True, self._waiting.pop()
            self.graph.after(WORK_S, lambda: self._finish(item))

    def _finish(self, item: Item) -> None:
        self._busy = False
        try:
            self._work(item)
        except Exception as error:  # noqa: BLE001 - one bad measurement must not end the node, as in flight
            rospy.logdebug(f"{type(error).__name__}: {error}")
        self._begin()


class OfflineReporter:
    """Reports extern transitions and their reasons, each as a call that was accepted; see ``resource_reporter.ResourceReporter``."""

    graph: Graph

    def __init__(self, skillset: str) -> None:
        self._skillset = skillset
        self._shown: dict[str, tuple[str, str]] = {}

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Say that the hardware's resource has this state, and why.

        What the skillset shows before the first call is not known here: a reason alone is told only of what was said here.
        """
        before, known = self._shown.get(resource, ("UNKNOWN", reason))
        if insist if before != state else reason not in {"", known}:
            self._shown[resource] = state, reason
            now_s = self.graph.now_ns / 1e9
            call = {
                "service": f"/{self._skillset}/transition",
                "request": {"resource": resource, "to": state, "reason": reason},
                "response": {"accepted": True, "reason": "", "state": state},
            }
            self.graph.publish(CALLS, String(data=json.dumps({**call, "error": "", "begin_s": now_s, "end_s": now_s})))


def install(graph: Graph) -> None:
    """Put a graph in place of rospy's own, for all modules that use it."""
    now = lambda: rospy.Time(graph.now_ns // 1_000_000_000, graph.now_ns % 1_000_000_000)  # noqa: E731
    OfflineWorker.graph = OfflineReporter.graph = graph
    genpy.Time.now = rospy.Time.now = staticmethod(now)

    def subscribe(name: str, kind: Any, callback: Callable[[Any], None], **_: object) -> OfflineSubscription:
        graph.subscribers.setdefault(graph.resolve(name), []).append((kind, callback))
        return OfflineSubscription()

    def repeat(period: Any, callback: Callable[[object], None], **_: object) -> None:
        def again() -> None:
            graph.after(period.to_sec(), again)
            callback(None)

        graph.after(period.to_sec(), again)

    replaced = {
        "Publisher": lambda name, *_, **__: OfflinePublisher(graph, name),
        "Subscriber": subscribe,
        "Service": lambda name, kind, handler: OfflineService(graph, name, kind, handler),
        "Timer": repeat,
        "get_time": lambda: graph.now_ns / 1e9,
        "get_param": lambda name, default=None: graph.own_parameters() if name == "~" else default,
        "set_param": lambda _name, _value: None,
        "is_shutdown": lambda: True,  # so threads that watch connections end at once
        "on_shutdown": lambda _job: None,
    }
    for name, value in replaced.items():
        setattr(rospy, name, value)
