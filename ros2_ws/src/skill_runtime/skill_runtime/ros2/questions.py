"""Questions to the managers that end, whatever gets lost: asked again after a while, given up after their time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from skill_runtime.waiting import Host, Pending

AGAIN_S = 1.0
"""An answer that has not come for so long (wall clock) is taken for lost: DDS loses those to clients it has not discovered yet."""
PATIENCE_S = 5.0
HOOK_PATIENCE_S = 15.0
"""For questions that a hook has to answer: the managers give it 10 s."""


class Question:
    """One question under way; ``settle`` makes the answer of the response."""

    def __init__(
        self, client: Any, request: Any, pending: Pending[Any], settle: Callable[[Any, int], object], *, patience_s: float, again_s: float
    ) -> None:
        self._client = client
        self._request = request
        self._pending = pending
        self._settle = settle
        self._again_s = again_s
        self._patience_s = patience_s
        self._tries = 0
        self._due_s = time.monotonic()
        self._ends_s = time.monotonic() + patience_s

    @property
    def open(self) -> bool:
        """Tell whether the answer is still awaited."""
        return not self._pending.done

    def tick(self) -> None:
        """Ask, ask again, or give up."""
        now_s = time.monotonic()
        if now_s > self._ends_s:
            there = "did not answer" if self._client.service_is_ready() else "is not there"
            self._pending.fail(f"service {self._client.srv_name} {there} within {self._patience_s:g} s")
        elif now_s >= self._due_s and self._client.service_is_ready():
            self._due_s = now_s + self._again_s
            self._tries += 1
            self._client.call_async(self._request).add_done_callback(self._take)

    def give_up(self, reason: str) -> None:
        """End without an answer."""
        self._pending.fail(reason)

    def _take(self, future: Any) -> None:
        response = future.result()
        if response is not None and self.open:
            self._pending.resolve(self._settle(response, self._tries))


class Questions:
    """The services of one skillset as its client calls them; all on the executor's thread but ``ask``."""

    def __init__(self, node: Node, group: CallbackGroup, host: Host, wake: Callable[[], None]) -> None:
        self._node = node
        self._group = group
        self._host = host
        self._wake = wake
        self._clients: dict[str, Any] = {}
        self._open: list[Question] = []
        self._lock = threading.Lock()

    def prepare(self, kind: Any, service: str) -> None:
        """Have DDS discover a service early: the first answer of one that was just met may get lost."""
        with self._lock:
            if service not in self._clients:
                self._clients[service] = self._node.create_client(kind, service, callback_group=self._group)

    def ask(
        self,
        kind: Any,
        service: str,
        request: Any,
        settle: Callable[[Any, int], Any],
        *,
        patience_s: float = PATIENCE_S,
        again_s: float = AGAIN_S,
    ) -> Pending[Any]:
        """Ask; ``settle(response, tries)`` makes the answer. Never waits."""
        self.prepare(kind, service)
        pending: Pending[Any] = Pending(self._host)
        question = Question(self._clients[service], request, pending, settle, patience_s=patience_s, again_s=again_s)
        with self._lock:
            self._open.append(question)
        question.tick()
        self._wake()
        return pending

    @property
    def restless(self) -> bool:
        """Tell whether ``tick`` has to be called."""
        return bool(self._open)

    def tick(self) -> None:
        """Go on with what is open."""
        with self._lock:
            questions = self._open = [question for question in self._open if question.open]
        for question in questions:
            question.tick()

    def give_up(self, reason: str) -> None:
        """End all without an answer."""
        with self._lock:
            questions, self._open = self._open, []
        for question in questions:
            question.give_up(reason)
