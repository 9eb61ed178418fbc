"""How the resource manager and a skill manager in another process speak: what both ends have in common.

Two topics a skill, ``managers/<skill>/requests`` to the resource manager and ``managers/<skill>/calls`` to the skill manager, both
reliable and in order. Each end is an instance with a name of its own: one that was started anew is somebody else.

To the resource manager (body): ``hello``: who are you? until ``welcome``; ``request`` (inputs), ``interrupt``, ``progress`` (value),
``outputs`` (outputs) of the execution ``id``; ``terminate`` (result, message, outputs), ``fail`` (message), ``interrupted`` (message), of
the execution ``execution``, answered by ``reply`` of the same ``id``; ``answer`` (value, error, trace) to the call ``id``.
To the skill manager: ``welcome``; ``stranger``: you are not the skill manager that I know, say hello; ``call`` (hook, execution, ...),
answered by ``answer`` of the same ``id``; ``event`` (state, result, message, outputs) of the execution ``id``; ``reply`` (value).
Both ways: ``ping``, answered by ``pong``.

When DDS tells that a process has ended or gives no sign of life, the other end is pinged: the lost one may have been another
one, of long ago, and a starved process may only have been late.
"""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from skillset_interfaces.msg import ManagerMessage

from skill_runtime.ros2.names import LINK, LIVELINESS_LEASE_S

DOUBT_S = 2.0
"""Who has not answered a ping for so long (wall clock) after a loss was noticed is gone."""
TICK_S = 0.1
GONE = f"its process ended, or gave no sign of life for {LIVELINESS_LEASE_S:g} s"
Body = Mapping[str, Any]


class LinkEnd:
    """One end: sends, receives, and finds out whether the other end is gone. All callbacks come on the node's executor."""

    def __init__(self, node: Node, *, to: str, of: str, on_message: Callable[[Any], None], on_gone: Callable[[], None]) -> None:
        self.instance = uuid.uuid4().hex[:12]
        self._on_message = on_message
        self._on_gone = on_gone
        self._doubt_ends_s: float | None = None
        self._publisher = node.create_publisher(ManagerMessage, to, LINK)
        node.create_subscription(
            ManagerMessage, of, self._hear, LINK, event_callbacks=SubscriptionEventCallbacks(liveliness=self._on_liveliness)
        )
        self._timer: Any = node.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)

    def send(self, receiver: str, kind: str, identifier: str = "", body: Body | None = None) -> None:
        """Send, from any thread."""
        text = json.dumps(body) if body else "{}"
        self._publisher.publish(ManagerMessage(sender=self.instance, receiver=receiver, kind=kind, id=identifier, body_json=text))

    def trust(self) -> None:
        """Take a sign of life of the other end."""
        self._doubt_ends_s = None

    def _hear(self, message: Any) -> None:
        if message.receiver not in {"", self.instance}:
            return
        if message.kind == "ping":
            self.send(message.sender, "pong")
        self._on_message(message)

    def _on_liveliness(self, info: Any) -> None:
        """Notice a loss by the changes: the counts are wrong where both sides are in one process (alive from 0 to -1)."""
        if info.alive_count_change < 0 or info.not_alive_count_change > 0:
            self._doubt_ends_s = time.monotonic() + DOUBT_S
            self.send("", "ping")
            self._timer.reset()

    def _tick(self) -> None:
        if self._doubt_ends_s is None:
            self._timer.cancel()
        elif time.monotonic() > self._doubt_ends_s:
            self._doubt_ends_s = None
            self._on_gone()
