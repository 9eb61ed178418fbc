"""Whether the managers of a skillset can be called: which they are, that they live, and that nothing sent would be lost."""

from __future__ import annotations

import threading
from collections.abc import Callable

from alula.model.json_form import from_json
from alula.model.model import Skillset
from alula.runtime.middleware import ActionLink, GoalListener, Middleware
from alula.runtime.timers import Job

DESCRIBE_S = 5.0
DOUBT_S = 1.0
"""Managers that do not answer for so long (wall clock) after their heartbeats stayed away are gone."""
RIVALS_NS = 1_000_000_000
"""Managers that send a message so long after others had replaced them still live: there are two."""


class Connection:
    """Follows whether the managers live and can be called, on the middleware's loop; any thread may wait for ``ready``.

    A starved process may only be late: managers whose heartbeats stay away are asked, and are gone when they don't answer.

    Args:
        middleware: the client's.
        skillset: its name.
        goals: told of feedback and endings of goals.
        on_restart: called when other managers have taken the place of those that were known.
        on_alive: called when managers that were taken for dead are heard of again, or new ones for the first time.
        on_gone: called when managers are gone.
    """

    def __init__(self, middleware: Middleware, skillset: str, goals: GoalListener, *, on_restart: Job, on_alive: Job, on_gone: Job) -> None:
        self.ready = threading.Event()
        self.model: Skillset | None = None
        self.links: dict[str, ActionLink] = {}
        self.subscriptions: list[Callable[[], bool]] = []
        self.instance_id = ""
        self.gone = False
        """Whether managers were there and are no more."""
        self._middleware = middleware
        self._skillset = skillset
        self._goals = goals
        self._on_restart = on_restart
        self._on_alive = on_alive
        self._on_gone = on_gone
        self._alive = False
        self._doubted = False
        self._described = ""
        self._unusable = ""
        """The managers whose description can't be used; each is reported once."""
        self._states_of = ""
        self._asking = False
        self._looking = False
        self._past: dict[str, int] = {}

    def on_message(self, instance_id: str, stamp_ns: int = 0) -> bool:
        """Take a message of managers; False when others have replaced them, and it comes late."""
        if instance_id in self._past:
            if stamp_ns > self._past[instance_id] + RIVALS_NS:
                self._past[instance_id] = stamp_ns
                self._middleware.log(f"two processes manage the skillset {self._skillset}; end one of them")
            return False
        if instance_id != self.instance_id:
            if self.instance_id:
                self._past[self.instance_id] = self._middleware.now_ns()
            self.instance_id = instance_id
            self.ready.clear()
            self._on_restart()
        return True

    def on_states(self) -> None:
        """Note that the resources of the present managers are known."""
        if self._states_of != self.instance_id:
            self._states_of = self.instance_id
            self._look()

    def on_heartbeat(self, instance_id: str, stamp_ns: int = 0) -> None:
        """Take a heartbeat; ``stamp_ns``: when it was sent (mission clock), 0 where that is not known."""
        if not self.on_message(instance_id, stamp_ns):
            return
        self._doubted = False
        if not self._alive:
            self._alive, self.gone = True, False
            self._on_alive()
        if instance_id not in {self._described, self._unusable}:
            self._ask(DESCRIBE_S)
        self._look()

    def on_doubt(self) -> None:
        """Ask managers whose heartbeats stay away."""
        if self._alive:
            self._doubted = True
            self._ask(DOUBT_S)

    def close(self) -> None:
        """Stop: not alive, not ready, and no callback any more."""
        self._alive = False
        self.ready.clear()

    def _ask(self, timeout_s: float) -> None:
        """Have the managers describe themselves, unless that is under way."""
        if not self._asking:
            self._asking = True
            instance_id = self.instance_id
            self._middleware.call("describe", {}, lambda text, _: self._use(instance_id, text), self._on_silence, timeout_s=timeout_s)

    def _use(self, instance_id: str, model_json: str) -> None:
        self._asking = self._doubted = False
        try:
            self._take(model_json)
        except Exception as error:  # noqa: BLE001 - of another version, or of types that are not installed here
            if self._unusable != instance_id:
                self._unusable = instance_id
                self._middleware.log(f"the managers of {self._skillset} can't be called: {type(error).__name__}: {error}")
        else:
            self._described = instance_id
        if instance_id != self.instance_id:
            self._ask(DESCRIBE_S)
        self._look()

    def _take(self, model_json: str) -> None:
        model = from_json(model_json)
        if model != self.model:
            for skill in model.skills:
                if skill.name not in self.links:
                    self.links[skill.name] = self._middleware.action(skill.name, self._goals)
            self.model = model

    def _on_silence(self, reason: str) -> None:  # noqa: ARG002 - the reason is of no use to callers
        self._asking = False
        if self._alive and not self._doubted:
            # They live, and are slow or just starting; if they end, the middleware will call `on_doubt`.
            self._middleware.later(DOUBT_S, self._ask_again)
        elif self._alive:
            self._alive, self.gone = False, True
            self.ready.clear()
            self._on_gone()

    def _ask_again(self) -> None:
        if self._alive and self.instance_id not in {self._described, self._unusable}:
            self._ask(DESCRIBE_S)

    def _look(self) -> None:
        """Be ready once the managers are alive and known, and connected in both directions."""
        if self._known and not self._looking and not self.ready.is_set():
            self._looking = True
            self._middleware.when(lambda: not self._known or self._connected, self._settle)

    def _settle(self) -> None:
        self._looking = False
        if self._known and self._connected:
            self.ready.set()

    @property
    def missing(self) -> str:
        """What has not been received yet that calls of the managers need, in words; empty when nothing is missing."""
        if not self._alive:
            return "a heartbeat"
        if self._unusable == self.instance_id:
            return "a description that can be used here"
        if not self._known:
            return "their description" if self._described != self.instance_id else "the states of their resources"
        if not all(connected() for connected in self.subscriptions):
            return "a connection to their topics"
        return ", ".join(f"the action {skill}" for skill, link in list(self.links.items()) if not link.connected)

    @property
    def _known(self) -> bool:
        return self._alive and self.instance_id == self._described == self._states_of

    @property
    def _connected(self) -> bool:
        return all(connected() for connected in self.subscriptions) and all(link.connected for link in list(self.links.values()))
