"""The client of one skillset, generic: all it needs it gets from ``describe``. The same over every middleware."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from typing import Any

from alula.common.plain import to_plain
from alula.model.model import Data, Skillset
from alula.runtime.callbacks import Unsubscribe
from alula.runtime.client.feed import Feed
from alula.runtime.client.goal import GoalTracker
from alula.runtime.client.state_sync import OnChange, OnEvent, OnSkills, StateSync
from alula.runtime.core.records import SkillRecord
from alula.runtime.core.replies import TransitionReply
from alula.runtime.core.why import Why
from alula.runtime.handle import Ended, SkillHandle
from alula.runtime.middleware import CALL_S, Middleware
from alula.runtime.views import DataReading, SkillsetView
from alula.runtime.waiting import Pending

HOOK_CALL_S = 15.0
"""For questions that a hook has to answer: the managers give it 10 s."""


class Client:
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    Nothing here waits but ``wait_ready``. Callbacks come on the middleware's loop, and must not wait there.
    """

    def __init__(self, middleware: Middleware, skillset: str) -> None:
        self.skillset = skillset
        self._middleware = middleware
        self._feeds: dict[str, Feed] = {}
        self._feeding = threading.Lock()
        self._sync = StateSync(middleware, skillset)
        self._connection = self._sync.connection

    # --- the managers ------------------------------------------------------------------------------------------------

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock; mission clock where time is virtual) until the managers can be called; False when they can't in time.

        Over rclpy, the node is spun when it has no executor; where time is virtual, the world runs.

        Raises:
            CannotWaitError: this is the thread that would bring the answer.
        """
        return self.ready or self._middleware.waiter.wait(self._connection.ready, timeout_s)

    @property
    def ready(self) -> bool:
        """Return whether the managers are alive, known and can be called."""
        return self._connection.ready.is_set()

    @property
    def missing(self) -> str:
        """What has not been received yet that calls of the managers need, in words; empty when nothing is missing."""
        return self._connection.missing

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._connection.model is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._connection.model

    @property
    def view(self) -> SkillsetView:
        """Return the skillset as attributes; raise RuntimeError before ``wait_ready``."""
        return SkillsetView(self)

    def close(self, reason: str = "") -> None:
        """End every wait for this reason, and this client's connections; what runs goes on running."""
        if not self._sync.closed:
            self._sync.close(reason or f"the client of {self.skillset} was closed")
            self._middleware.close()

    # --- what is known -----------------------------------------------------------------------------------------------

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty before the managers' first message, and once they are gone."""
        return {} if self._connection.gone else dict(self._sync.resources)

    @property
    def reasons(self) -> dict[str, str]:
        """The reason that the functional layer reported for each resource's state, by name; empty where it reported none."""
        return {} if self._connection.gone else dict(self._sync.reasons)

    @property
    def skills(self) -> dict[str, SkillRecord]:
        """Return, by skill, its open executions and its last end; empty before the managers' first message, and once they are gone."""
        return {} if self._connection.gone else dict(self._sync.skills)

    def last(self, skill: str) -> Ended[dict[str, Any], str] | None:
        """Return how the skill's last execution ended, of any caller and at any time; None when none has.

        Raises:
            ValueError: there is no such skill.
        """
        self._check_skill(skill)
        known = self._sync.last.get(skill)
        if known is None:
            return None
        ended = known[1]
        plain = {name: value for name, value in ended.outputs.items() if value is not None}
        outputs = self._connection.links[skill].outputs_of(plain)
        return Ended(skill, ended.id, ended.state, ended.result, ended.message, outputs)

    def on_change(self, callback: OnChange) -> Unsubscribe:
        """Call ``callback(resources)`` after each step that changed a resource; the return value unsubscribes."""
        return self._sync.on_changes.add(callback)

    def on_event(self, callback: OnEvent) -> Unsubscribe:
        """Call ``callback(event)`` for each event from now on, an ``EngineEvent``; the return value unsubscribes."""
        return self._sync.on_events.add(callback)

    def on_skills(self, callback: OnSkills) -> Unsubscribe:
        """Call ``callback(skills)`` after changes, with a ``SkillRecord`` by skill; the return value unsubscribes."""
        return self._sync.on_skills.add(callback)

    def data_feed(self, name: str, every_s: float = 0.0) -> Feed:
        """Return the feed of a data, subscribed to at the first call, from any thread; it has at most one value in ``every_s`` seconds.

        Raises:
            ValueError: there is no such data.
        """
        data = self._find_data(name)
        with self._feeding:
            if name not in self._feeds:
                self._feeds[name] = Feed(self._middleware, data, self.read_data, every_s)
            return self._feeds[name]

    def input_types(self, skill: str) -> dict[str, str]:
        """Return a skill's inputs with their types, as ``{"height": "float64"}``; raise ValueError."""
        self._check_skill(skill)
        return self._connection.links[skill].input_types

    # --- skills ------------------------------------------------------------------------------------------------------

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A message may be given as a mapping of its fields, a point as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._connection.model is None:
            return self._not_started(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._not_started(skill)
        link = self._connection.links[skill]
        tracker = GoalTracker(self._middleware, self.skillset, skill, link, self._sync, pause=self.set_paused, on_over=self._sync.over)
        self._sync.follow(tracker, goal)
        return tracker.handle

    def interrupt_all(self, skill: str) -> Pending[int]:
        """Ask for the end of all executions of a skill, of any caller; the answer is how many there were."""
        self._check_skill(skill)
        pending = self._open_question()
        if pending.done:
            return pending
        known = self._sync.skills.get(skill, SkillRecord())
        counted = lambda count: pending.resolve(len(known.open) if count is None else count)  # noqa: E731
        self._connection.links[skill].cancel_all(counted, pending.fail)
        return pending

    def set_paused(self, execution_id: str, paused: bool) -> Pending[str]:  # noqa: FBT001 - as the service has it
        """Ask for a pause or a resumption; the answer is "", or why not."""
        request = {"id": execution_id, "paused": paused}
        # Asked once only: a hook that takes its time would be asked again.
        return self._ask("pause", request, lambda reply, _: "" if reply.accepted else reply.reason, timeout_s=HOOK_CALL_S, once=True)

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask whether the skill could start now, and if not, why not; with inputs its ``validate`` is asked, too.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        self._check_skill(skill)
        inputs_json = "" if inputs is None else json.dumps(to_plain(self._goal(skill, inputs)))

        def answer(reply: Any, _: int) -> Why:
            why: Why | None = reply.why
            return Why(skill, False, reply.error, "", (), ()) if why is None else Why(skill, *_parts(why))

        return self._ask("why", {"skill": skill, "inputs_json": inputs_json}, answer, timeout_s=HOOK_CALL_S)

    # --- resources and data ------------------------------------------------------------------------------------------

    def transition(self, resource: str, to: str, reason: str = "") -> Pending[TransitionReply]:
        """Ask for an extern transition, as the functional layer does; ``reason``: why the resource is so, in words."""

        def answer(reply: TransitionReply, tries: int) -> TransitionReply:
            # An answer that got lost may have been that the transition was taken.
            accepted = reply.accepted or (tries > 1 and reply.state == to)
            return TransitionReply(accepted, "" if accepted else reply.reason, reply.state)

        return self._ask("transition", {"resource": resource, "to": to, "reason": reason}, answer)

    def trigger(self, event: str) -> Pending[TransitionReply]:
        """Ask for an event of the model; the request is never repeated, as the event may be possible several times."""
        return self._ask("trigger", {"event": event}, lambda reply, _: reply, once=True)

    def read_data(self, name: str) -> Pending[DataReading]:
        """Ask the managers for a data's value as JSON, also of a type that this process does not have."""
        return self._ask("get_data", {"name": name}, lambda reading, _: reading)

    def moment(self) -> Pending[Any]:
        """Return an answer to be resolved by the caller; it fails when the managers are gone."""
        return self._sync.moment()

    # --- inside ------------------------------------------------------------------------------------------------------

    def _ask(
        self,
        service: str,
        request: Mapping[str, object],
        answer: Callable[[Any, int], Any],
        *,
        timeout_s: float = CALL_S,
        once: bool = False,
    ) -> Pending[Any]:
        """Ask; ``answer(reply, tries)`` makes the answer. Never waits."""
        pending = self._open_question()
        if pending.done:
            return pending
        settle = lambda reply, tries: pending.resolve(answer(reply, tries))  # noqa: E731
        self._middleware.call(service, request, settle, pending.fail, timeout_s=timeout_s, once=once)
        return pending

    def _open_question(self) -> Pending[Any]:
        """Return an answer to wait for; it has failed already where none can be given."""
        pending = self.moment()
        if self._sync.closed or self._connection.gone:
            pending.fail(self._sync.closed or self._not_there())
        return pending

    def _goal(self, skill: str, inputs: Mapping[str, object]) -> Any:
        """Make the goal; raise ValueError when skill or inputs are wrong."""
        self._check_skill(skill)
        place = f"inputs of {self.skillset}.{skill}"
        goal = self._connection.links[skill].fit(inputs, place)
        missing = [parameter.name for parameter in self.model.skill(skill).inputs if parameter.name not in inputs]
        if missing:
            raise ValueError(f"{place}: {', '.join(missing)} missing")
        return goal

    def _check_skill(self, skill: str) -> None:
        known = [known.name for known in self.model.skills]
        if skill not in known:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(known)}")

    def _find_data(self, name: str) -> Data:
        known = {data.name: data for data in self.model.data}
        if name not in known:
            raise ValueError(f"skillset {self.skillset} has no data {name!r}; it has {', '.join(known) or 'none'}")
        return known[name]

    def _not_there(self) -> str:
        return f"the managers of {self.skillset} are not there"

    def _not_started(self, skill: str) -> SkillHandle:
        """Return the handle of an execution that can't be asked for now."""
        handle = SkillHandle(skill, "", waiter=self._middleware.waiter)
        handle.fail(self._not_there())
        return handle


def _parts(why: Why) -> tuple[Any, ...]:
    return why.ready, why.reason, why.refusal, why.unmet, why.history
