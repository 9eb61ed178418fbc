"""Whether the managers of a skillset can be called, and over what; used by the client's thread only."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from skillset_interfaces.srv import Describe, DescribeRequest

from skill_model.json_form import from_json
from skill_model.model import Skillset
from skillset_ros1.calls import call
from skillset_ros1.link import SkillLink, is_connected
from skillset_ros1.names import action_types, interfaces_of
from skillset_ros1.presence import DOUBT_S, Presence, Verdict

DESCRIBE_S = 5.0
Handler = Callable[[Any], None]
OnThread = Callable[[Handler], Handler]
"""Returns a callback that has a handler called on the client's thread."""


class Reach:
    """The description, the topics of the skills, and whether all of it is there; ``ready`` may be waited for by anybody."""

    def __init__(self, place: str, skillset: str, on_thread: OnThread, on_feedback: Handler, on_result: Handler) -> None:
        self.model: Skillset | None = None
        self.links: dict[str, SkillLink] = {}
        self.ready = threading.Event()
        self.presence = Presence()
        self._place = place
        self._skillset = skillset
        self._on_thread = on_thread
        self._on_feedback = on_feedback
        self._on_result = on_result
        self._server = ""
        self._asking = False

    def on_alive(self, message: Any) -> None:
        """Take a sign of life that counts; ask who these managers are unless that is known."""
        self._server = message._connection_header["callerid"]  # noqa: SLF001 - rospy's way to tell who sent it
        if self.model is None:
            self._ask(DESCRIBE_S)

    def gone(self, signs: Any) -> bool:
        """Take the next step towards certainty about a loss, once a while; True when it is certain, once. ``signs`` is subscribed to."""
        verdict = self.presence.check(time.monotonic(), connected=is_connected(signs))
        if verdict is Verdict.ASK:
            self._ask(DOUBT_S)
        elif verdict is Verdict.GONE:
            self.ready.clear()
        return verdict is Verdict.GONE

    def look(self, subscribers: list[Any]) -> None:
        """Be ready when the managers are alive and nothing that is sent between here and there would be lost."""
        if self.ready.is_set() or not self.presence.alive or self.model is None:
            return
        if all(is_connected(s, self._server) for s in subscribers) and all(x.connected(self._server) for x in self.links.values()):
            self.ready.set()

    def _ask(self, timeout_s: float) -> None:
        """Ask for the description, unless that is under way."""
        if not self._asking:
            self._asking = True
            answered, silent = self._on_thread(self._on_description), self._on_thread(self._on_silence)
            call(f"{self._place}/describe", Describe, DescribeRequest(), answered, silent, timeout_s=timeout_s)

    def _on_description(self, answer: Any) -> None:
        self._asking = False
        self.presence.answered(time.monotonic())
        if self.model is None:
            model = from_json(answer.model_json)
            interfaces = interfaces_of(self._skillset)
            feedback, result = self._on_thread(self._on_feedback), self._on_thread(self._on_result)
            for skill in model.skills:
                types, where = action_types(interfaces, skill.name), f"{self._place}/skill/{skill.name}"
                self.links[skill.name] = SkillLink(where, types, feedback, result)
            self.model = model

    def _on_silence(self, reason: str) -> None:
        self._asking = False
        rospy.logdebug("%s", reason)
