"""Keep a client's state in step with one skillset's managers: their messages, put into one order on the middleware's loop.

The messages of different topics arrive in any order. Events are numbered, and resource states carry the number of the last event that
they include. So a caller that learns of an execution's end sees the resources as they are after it, and one that sees a resource's state
has received the event that has led to it: a record of the events has all that a decision was made of.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakSet

from alula.runtime.callbacks import Callbacks
from alula.runtime.client.connection import Connection
from alula.runtime.client.goal import GRACE_S, GoalTracker
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.core.records import ExecutionRecord, SkillRecord
from alula.runtime.middleware import (
    EVENTS,
    RESOURCE_STATES,
    SKILL_STATES,
    GoalResult,
    Middleware,
    ResourceStates,
    SkillStates,
)
from alula.runtime.timers import Timer
from alula.runtime.waiting import Pending

OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[EngineEvent], None]
OnSkills = Callable[[dict[str, SkillRecord]], None]


class StateSync:
    """All that a client knows; the goals that it follows, and the orphans: goals that it has given up and that may still run."""

    def __init__(self, middleware: Middleware, skillset: str) -> None:
        self.skillset = skillset
        self.resources: dict[str, str] = {}
        self.reasons: dict[str, str] = {}
        self.skills: dict[str, SkillRecord] = {}
        self.last: dict[str, tuple[int, ExecutionEvent | ExecutionRecord]] = {}
        self.on_changes: Callbacks[OnChange] = Callbacks()
        self.on_events: Callbacks[OnEvent] = Callbacks()
        self.on_skills: Callbacks[OnSkills] = Callbacks()
        self.states_after = -1
        self.received = 0
        self.closed = ""
        self.connection = Connection(
            middleware, skillset, self, on_restart=self._on_restart, on_alive=self._cancel_orphans, on_gone=self._on_gone
        )
        self._middleware = middleware
        self._lock = threading.Lock()
        self._open: dict[str, GoalTracker] = {}
        self._orphans: dict[str, GoalTracker] = {}
        self._pending: WeakSet[Pending[Any]] = WeakSet()
        self._last_event = self._last_transition = 0
        self._early: deque[tuple[ResourceStates, Timer]] = deque()
        """Resource states that include events which have not come, each with the timer that ends the waiting."""
        self.connection.subscriptions = [
            middleware.subscribe(EVENTS, self._on_event),  # first: where both have come, the event is taken first
            middleware.subscribe(RESOURCE_STATES, self._on_states),
            middleware.subscribe(SKILL_STATES, self._on_skills),
        ]
        middleware.watch(self.connection.on_heartbeat, self.connection.on_doubt)

    # --- for the client, from any thread -----------------------------------------------------------------------------

    def follow(self, tracker: GoalTracker, goal: Any) -> None:
        """Send a goal and follow it to its end."""
        with self._lock:
            self._open[tracker.handle.id] = tracker
        tracker.send(goal)

    def over(self, tracker: GoalTracker, orphan: bool) -> None:  # noqa: FBT001 - as trackers tell it
        """Stop following a goal; an orphan is cancelled at the next message about it."""
        with self._lock:
            self._open.pop(tracker.handle.id, None)
            if orphan:
                self._orphans[tracker.handle.id] = tracker
        if not orphan:
            tracker.link.release(tracker.handle.id)

    def moment(self) -> Pending[Any]:
        """Return an answer to be resolved by the caller; it fails when the managers are gone."""
        pending: Pending[Any] = Pending(self._middleware.waiter)
        with self._lock:
            self._pending.add(pending)
        return pending

    def close(self, reason: str) -> None:
        """End every wait for this reason; what runs goes on running."""
        self.closed = self.closed or reason
        self._forget_early()
        self.connection.close()
        self._abandon(reason, orphans=False)

    # --- feedback and results of goals ---------------------------------------------------------------------------------------------

    def on_feedback(self, goal_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Take the feedback of a goal."""
        tracker = self._open.get(goal_id)
        if tracker is not None:
            tracker.on_feedback(progress, outputs)

    def on_result(self, goal_id: str, ending: GoalResult | None) -> None:
        """Take the result of a goal."""
        tracker = self._open.get(goal_id)
        if tracker is not None:
            tracker.on_result(ending)

    # --- messages of topics --------------------------------------------------------------------------------------------

    def _on_states(self, states: ResourceStates) -> None:
        if self.closed or not self.connection.on_message(states.instance_id, states.stamp_ns):
            return
        self.received += 1
        if self.states_after >= 0 and (self._early or states.sequence > self._last_event):
            # Its event may have got lost.
            self._early.append((states, self._middleware.later(GRACE_S, lambda: self._show_early(states.sequence))))
        else:
            self._show(states)

    def _show_early(self, sequence: int) -> None:
        """Show the states that include no event beyond this one."""
        while self._early and self._early[0][0].sequence <= sequence:
            states, timer = self._early.popleft()
            timer.cancel()
            self._show(states)

    def _forget_early(self) -> None:
        while self._early:
            self._early.popleft()[1].cancel()

    def _show(self, states: ResourceStates) -> None:
        if self.closed or self._is_old(states):
            return
        self.states_after = states.sequence
        self.resources = {name: value.state for name, value in states.resources.items()}
        self.reasons = {name: value.reason for name, value in states.resources.items()}
        try:
            for callback in self.on_changes:
                callback(dict(self.resources))
        finally:
            for tracker in self._trackers():
                tracker.settle()
            self.connection.on_states()

    def _is_old(self, states: ResourceStates) -> bool:
        """Return whether these states were known before; without a transition there may be a new reason."""
        known = states.sequence == self.states_after and all(self.reasons.get(name) == one.reason for name, one in states.resources.items())
        return states.sequence < self.states_after or known

    def _on_event(self, event: EngineEvent) -> None:
        # An event that was published while the history was on its way comes twice.
        if self.closed or not self.connection.on_message(event.instance_id, event.stamp_ns) or event.sequence <= self._last_event:
            return
        self.received += 1
        gap = event.sequence > self._last_event + 1 and self._last_event > 0
        self._last_event = event.sequence
        if isinstance(event, TransitionEvent):
            self._last_transition = event.sequence
        if gap:
            self._request_results()
        try:
            for callback in self.on_events:
                callback(event)
        finally:
            # Also after a callback has raised: the handle of a goal that has ended must end.
            if isinstance(event, ExecutionEvent):
                self._follow_event(event)
            self._show_early(self._last_event)

    def _follow_event(self, event: ExecutionEvent) -> None:
        if event.state.terminal:
            self._keep_last(event.skill, event.stamp_ns, event)
            orphan = self._orphans.pop(event.id, None)
            if orphan is not None:
                orphan.link.release(event.id)
        elif event.id in self._orphans:
            self._orphans[event.id].link.cancel(event.id)
        tracker = self._open.get(event.id)
        if tracker is not None:
            tracker.on_event(event, self._last_transition)

    def _on_skills(self, states: SkillStates) -> None:
        if self.closed or not self.connection.on_message(states.instance_id, states.stamp_ns):
            return
        self.skills = dict(states.skills)
        for name, skill in states.skills.items():
            if skill.last is not None and skill.last.ended_ns is not None:
                self._keep_last(name, skill.last.ended_ns, skill.last)
        for callback in self.on_skills:
            callback(dict(self.skills))

    def _keep_last(self, skill: str, stamp_ns: int, ended: ExecutionEvent | ExecutionRecord) -> None:
        if skill not in self.last or self.last[skill][0] <= stamp_ns:
            self.last[skill] = (stamp_ns, ended)

    # --- heartbeats ----------------------------------------------------------------------------------------------------

    def _on_restart(self) -> None:
        """Drop what was known of earlier managers: these are others."""
        self._last_event, self._last_transition, self.states_after = 0, 0, -1
        self._forget_early()
        self.last.clear()
        # A goal without an acknowledgement may still be on its way, also to restarted managers.
        ended = [tracker for tracker in self._orphans.values() if tracker.instance_id]
        for tracker in ended:
            del self._orphans[tracker.handle.id]
            tracker.link.release(tracker.handle.id)
        for tracker in self._trackers():
            if tracker.instance_id:
                tracker.abandon(f"the managers of {self.skillset} were restarted and do not know this execution")

    def _on_gone(self) -> None:
        self._abandon(f"the managers of {self.skillset} have gone: they ended, or sent no heartbeat", orphans=True)

    def _cancel_orphans(self) -> None:
        for goal_id, tracker in list(self._orphans.items()):
            tracker.link.cancel(goal_id)

    def _request_results(self) -> None:
        """Ask for the results of all goals, because events got lost."""
        for tracker in self._trackers():
            tracker.ask()

    def _abandon(self, reason: str, *, orphans: bool) -> None:
        for tracker in self._trackers():
            tracker.abandon(reason, orphan=orphans)
        with self._lock:
            pending = list(self._pending)
        for one in pending:
            one.fail(reason)

    def _trackers(self) -> list[GoalTracker]:
        with self._lock:
            return list(self._open.values())
