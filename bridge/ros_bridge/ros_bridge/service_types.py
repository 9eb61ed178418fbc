"""The types of ROS 1's services, which only their nodes know: asked in the background, each node by one thread at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor

from ros_bridge.hung_nodes import HungNodes

ASKING_THREADS = 32
AGAIN_AFTER_S = 1.0  # a service whose node has answered, but not with a type
Service = tuple[str, str]  # its name and its node's


class ServiceTypes:
    """What is known of the types of services. Safe from several threads."""

    def __init__(self, ask: Callable[[str], str | None], nodes: HungNodes) -> None:
        """``ask`` asks the node of a service for its type; it raises TimeoutError when it does not answer in time."""
        self.on_answer: Callable[[], None] = lambda: None
        self._ask = ask
        self._nodes = nodes
        self._changed = threading.Condition()
        self._known: dict[Service, str | None] = {}  # None: it was asked, and has not said it
        self._again_s: dict[Service, float] = {}
        self._under_way: set[str] = set()  # nodes
        self._threads = ThreadPoolExecutor(ASKING_THREADS, thread_name_prefix="service_types")

    def look(self, providers: Mapping[str, str]) -> tuple[dict[str, str], frozenset[str]]:
        """Return the types of these services (node by name), and those whose nodes are still being asked the first time.

        Asks, in other threads, what is not known. ``on_answer`` is called there when something has come.
        """
        now_s = time.monotonic()
        with self._changed:
            services = set(providers.items())
            self._known = {service: kind for service, kind in self._known.items() if service in services}
            self._again_s = {service: at_s for service, at_s in self._again_s.items() if service in services}
            by_node: dict[str, list[Service]] = {}
            for service in sorted(services):
                if self._known.get(service) is None and now_s >= self._again_s.get(service, 0.0):
                    by_node.setdefault(service[1], []).append(service)
            for node, wanted in by_node.items():
                if node not in self._under_way and self._nodes.may_be_asked(node):
                    self._under_way.add(node)
                    self._threads.submit(self._ask_node, node, wanted)
            types = {name: kind for (name, _), kind in self._known.items() if kind is not None}
            return types, frozenset(name for name, _ in services - self._known.keys())

    def _ask_node(self, node: str, services: Collection[Service]) -> None:
        answers: dict[Service, str | None] = dict.fromkeys(services)
        try:
            for service in services:
                answers[service] = self._ask(service[0])
            self._nodes.answers(node)
        except TimeoutError:
            self._nodes.hangs(node)
        finally:
            with self._changed:
                self._known |= answers
                self._again_s |= dict.fromkeys(services, time.monotonic() + AGAIN_AFTER_S)
                self._under_way.discard(node)
                self._changed.notify_all()
            self.on_answer()

    def wait(self, within_s: float) -> None:
        """Return when no node is being asked any more, or after this time."""
        with self._changed:
            self._changed.wait_for(lambda: not self._under_way, within_s)

    def close(self) -> None:
        """Ask no further node."""
        self.on_answer = lambda: None
        self._threads.shutdown(wait=False, cancel_futures=True)
