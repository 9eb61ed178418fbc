"""Finds the managers of a skillset, and notices when they have gone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from skillset_interfaces.msg import ResourceStates
from skillset_interfaces.srv import Describe

from skill_model.json_form import from_json
from skill_model.model import Skillset
from skill_runtime.ros2.names import ALIVE, action_module, action_type
from skill_runtime.ros2.resting_action import RestingActionClient

DESCRIBE_AGAIN_S = 1.0
DOUBT_S = 1.0
"""Managers that do not answer for so long (wall clock) after a loss was noticed are gone."""


class Presence:
    """Whether the managers can be called: they have described themselves, their resources were heard, their actions are there.

    When a manager process has ended, or its signs of life (sent by DDS itself, however busy the process is) have stayed
    away for the lease, whoever is there is asked for its description once more. The lost one may have been another one, of
    long ago, that DDS had not forgotten yet, and a starved process may only have been late.

    Args:
        node: serves it.
        skillset: the skillset's name.
        root: what its names begin with (default: the skillset's name, relative to the node's namespace).
        group: of the callbacks; the node's default group by default.
        on_resources: gets each ``ResourceStates``.
        on_doubt: called when a loss was noticed; from then on ``tick`` must be called while ``restless``.
        on_answer: called when somebody has answered after a loss; perhaps managers that were started anew.
        on_gone: called when nobody has.
    """

    def __init__(
        self,
        node: Node,
        skillset: str,
        *,
        on_resources: Callable[[Any], None],
        on_doubt: Callable[[], None],
        on_answer: Callable[[], None],
        on_gone: Callable[[], None],
        root: str = "",
        group: CallbackGroup | None = None,
    ) -> None:
        self._node = node
        self._skillset = skillset
        self._root = root or skillset
        self._group = group
        self._on_resources = on_resources
        self._on_doubt = on_doubt
        self._on_answer = on_answer
        self._on_gone = on_gone
        self.ready = threading.Event()
        self.model: Skillset | None = None
        self.actions: dict[str, Any] = {}
        self.clients: dict[str, Any] = {}
        self._heard = False
        self._answered = False
        self._asked_s = float("-inf")
        self._doubt_ends_s: float | None = None
        self._describe = node.create_client(Describe, f"{self._root}/describe", callback_group=group)
        node.create_subscription(
            ResourceStates,
            f"{self._root}/resource_states",
            self._hear,
            ALIVE,
            callback_group=group,
            event_callbacks=SubscriptionEventCallbacks(liveliness=self._on_liveliness),
        )

    @property
    def restless(self) -> bool:
        """Tell whether ``tick`` has to be called."""
        return self._doubt_ends_s is not None or not self.ready.is_set()

    def tick(self) -> None:
        """Take the next step towards being ready, or to certainty about a loss."""
        if not self._answered:
            self._ask()
        elif self._heard and all(client.server_is_ready() for client in self.clients.values()):
            self.ready.set()
        if self._doubt_ends_s is not None and time.monotonic() > self._doubt_ends_s:
            self._doubt_ends_s = None
            self.ready.clear()
            self._on_gone()

    def _ask(self) -> None:
        """Ask for the description, again after a while: the answer may be lost (see ``pursuit``)."""
        if self._describe.service_is_ready() and time.monotonic() - self._asked_s > DESCRIBE_AGAIN_S:
            self._asked_s = time.monotonic()
            self._describe.call_async(Describe.Request()).add_done_callback(self._on_description)

    def _on_description(self, future: Any) -> None:
        answer = future.result()
        if answer is None:
            return
        if self.model is None:
            self._use(answer.model_json)
        # Last: with an executor of several threads, `tick` may run at the same time.
        self._answered = True
        if self._doubt_ends_s is not None:
            self._doubt_ends_s = None
            self._on_answer()

    def _use(self, model_json: str) -> None:
        model = from_json(model_json)
        actions = action_module(self._skillset)
        for skill in model.skills:
            self.actions[skill.name] = action_type(actions, skill.name)
            name = f"{self._root}/skill/{skill.name}"
            self.clients[skill.name] = RestingActionClient(self._node, self.actions[skill.name], name, callback_group=self._group)
        self.model = model

    def _hear(self, message: Any) -> None:
        self._heard = True
        self._on_resources(message)

    def _on_liveliness(self, info: Any) -> None:
        """Notice a loss by the changes: the counts are wrong where both sides are in one process (alive from 0 to -1)."""
        if info.alive_count_change < 0 or info.not_alive_count_change > 0:
            self._answered = False
            self._asked_s = float("-inf")
            self._doubt_ends_s = time.monotonic() + DOUBT_S
            self._on_doubt()
