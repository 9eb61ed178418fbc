"""All managers of one skillset in the process of whoever runs the world: what ``SkillsetNode`` is on ROS 2."""

from __future__ import annotations

import logging
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from skill_model.json_form import to_json
from skill_model.model import Skill, Skillset
from skill_runtime.core.engine import SkillsetEngine, TransitionReply
from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.core.pauses import PauseReply
from skill_runtime.core.records import ExecutionRecord
from skill_runtime.core.why import Why
from skill_runtime.hooks import SkillHooks
from skill_runtime.local.clock import Job, Timer, VirtualClock
from skill_runtime.local.data import LocalData
from skill_runtime.staleness import STALE_PERIODS
from skill_runtime.views import Sample

_LOG = logging.getLogger(__name__)
HooksFactory = Callable[["LocalManagers"], Mapping[str, SkillHooks]]
EVENTS_KEPT = 1000
"""A late listener gets so many events at most, as from the latched topic."""


class Listener(Protocol):
    """What a client hears of managers."""

    def hear_step(self, resources: Mapping[str, str] | None, events: Sequence[EngineEvent]) -> None:
        """Get one step: the resources after it if any changed, and its events."""
        ...

    def hear_progress(self, execution_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Get a report of a running execution."""
        ...

    def hear_data(self, name: str, sample: Sample) -> None:
        """Get a value."""
        ...

    def hear_last(self, records: Sequence[ExecutionRecord]) -> None:
        """Learn how the last execution of each skill ended."""
        ...

    def hear_end(self, reason: str) -> None:
        """Learn that the managers have gone."""
        ...


class LocalManagers:
    """The data manager, the resource manager and the skill managers of a skillset.

    Hooks are called in jobs of the world's clock, one after another. A job of theirs that raises fails what runs, as a callback
    on ROS 2 does.
    """

    def __init__(self, clock: VirtualClock, skillset: Skillset, make_hooks: HooksFactory | Mapping[str, SkillHooks]) -> None:
        self.clock = clock
        self.skillset = skillset
        self.data = LocalData(clock, skillset)
        self.errors: list[str] = []
        self.alive = True
        self._listeners: list[Listener] = []
        self._on_step: list[Callable[[Sequence[EngineEvent]], None]] = []
        self._set_for: int | None = None
        self._history: deque[EngineEvent] = deque(maxlen=EVENTS_KEPT)
        self._hooks = make_hooks(self) if callable(make_hooks) else make_hooks
        self.engine = SkillsetEngine(
            skillset,
            lambda: clock.now_ns,
            self._hooks,
            self._on_events,
            defer=self.soon,
            on_error=self.note,
        )
        # Kept apart from the engine's, so that each step is told with the states after it.
        self._states = {name: status.state for name, status in self.engine.resources.items()}
        self._reports = {skill.name: _Reports(self, skill) for skill in skillset.skills if skill.progress is not None}

    def note(self, error: str) -> None:
        """Keep an error that no execution can carry."""
        self.errors.append(error)
        _LOG.error("%s: %s", self.skillset.name, error)

    # --- for hooks and the functional layer --------------------------------------------------------------------------

    def soon(self, job: Job) -> None:
        """Have a job done at this moment, after all that is due already."""
        self.clock.soon(lambda: self._do(job))

    def after(self, delay_s: float, job: Job) -> Timer:
        """Have a job done after a delay in seconds; not when the managers have gone by then."""
        return self.clock.after(delay_s, lambda: self._do(job))

    def transition(self, resource: str, to: str) -> TransitionReply:
        """Take an extern transition, or say why not."""
        return self.engine.transition(resource, to)

    def publish(self, name: str, value: object) -> None:
        """Give a data a new value; raise KeyError when the model has no such data."""
        self.data.receive(name, value)
        self.engine.update_data(name, value)
        stamp_ns, period_s = self.clock.now_ns, next(data.period_s for data in self.skillset.data if data.name == name)
        if period_s is not None:
            self.after(STALE_PERIODS * period_s + 1e-9, lambda: self._stale(name, stamp_ns))
        self._look()
        for listener in self._listeners:
            listener.hear_data(name, Sample(value, stamp_ns))

    def on_step(self, callback: Callable[[Sequence[EngineEvent]], None]) -> None:
        """Have ``callback(events)`` called at each step, within it: clients hear of it later."""
        self._on_step.append(callback)

    def describe(self) -> str:
        """Return the model as JSON."""
        return to_json(self.skillset)

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self.engine.close(reason)

    def vanish(self, reason: str) -> None:
        """Be gone at once, like a process that was killed: nothing is stopped, nothing is told but that."""
        self.alive = False
        listeners, self._listeners = self._listeners, []
        for listener in listeners:
            listener.hear_end(reason)

    # --- for clients -------------------------------------------------------------------------------------------------

    def listen(self, listener: Listener) -> None:
        """Tell a listener everything from now on, and before that what latched topics hold: states, events, last values."""
        self._listeners.append(listener)
        listener.hear_last([skill.last for skill in self.engine.skills.values() if skill.last is not None])
        listener.hear_step(dict(self._states), tuple(self._history))
        for data in self.skillset.data:
            reading = self.data.read(data.name)
            if reading.received:
                listener.hear_data(data.name, Sample(reading.value, reading.stamp_ns))

    def request(self, skill: str, values: Mapping[str, object], execution_id: str) -> None:
        """Take a request."""
        self._do(lambda: self._request(skill, values, execution_id))

    def interrupt(self, execution_id: str) -> None:
        """Take an interruption."""
        self._do(lambda: self.engine.interrupt(execution_id))

    def set_paused(self, execution_id: str, reply: Callable[[PauseReply], None], *, paused: bool) -> None:
        """Take a pause or a resumption; ``reply`` gets the answer."""
        self._do(lambda: self.engine.set_paused(execution_id, reply, paused=paused))

    def why(self, skill: str, values: Mapping[str, object] | None) -> Why:
        """Tell whether a skill could start now; with inputs, its ``validate`` is asked, too."""
        return self.engine.why(skill, None if values is None else self._hooks[skill].make_inputs(values))

    # --- parts -------------------------------------------------------------------------------------------------------

    def _stale(self, name: str, stamp_ns: int) -> None:
        if self.data.read(name).stamp_ns == stamp_ns:
            self.engine.update_data(name, None)
            self._look()

    def _look(self) -> None:
        """Have the engine ticked when something becomes due."""
        due_ns = self.engine.due_ns
        if due_ns is not None and due_ns != self._set_for:
            self._set_for = due_ns
            self.clock.at(due_ns, lambda: self._do(self._ring))

    def _ring(self) -> None:
        self._set_for = None
        self.engine.tick()
        self._look()

    def _request(self, skill: str, values: Mapping[str, object], execution_id: str) -> None:
        inputs = self._hooks[skill].make_inputs(values)
        if skill in self._reports:
            self._reports[skill].begin(execution_id)
        self.engine.request(skill, inputs, execution_id=execution_id)

    def _do(self, job: Job) -> None:
        if not self.alive:
            return
        try:
            job()
        except Exception as error:  # noqa: BLE001 - as on ROS 2, a callback of hooks ends what runs, not the managers
            last_line = "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
            self.note("".join(traceback.format_exception(error)))
            self.engine.fail_all(f"a callback raised {last_line}")

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        if not self.alive:
            return
        self._history.extend(events)
        changes = {event.resource: event.to_state for event in events if isinstance(event, TransitionEvent)}
        self._states |= changes
        for on_step in self._on_step:
            on_step(events)
        for listener in self._listeners:
            listener.hear_step(dict(self._states) if changes else None, events)
        for event in events:
            if isinstance(event, ExecutionEvent) and event.state.terminal and event.skill in self._reports:
                self._reports[event.skill].end(event.id)
        self._look()

    def report(self, execution_id: str) -> None:
        """Ask a running execution for its progress, and pass it on."""
        progress, execution = self.engine.progress(execution_id), self.engine.execution(execution_id)
        if progress is not None and execution is not None:
            for listener in self._listeners:
                listener.hear_progress(execution_id, progress, dict(execution.outputs))


class _Reports:
    """The progress reports of one skill: every period of the model while there are executions, as a timer on ROS 2."""

    def __init__(self, managers: LocalManagers, skill: Skill) -> None:
        self._managers = managers
        self._period_s = skill.progress.period_s if skill.progress is not None else 0.0
        self._open: dict[str, None] = {}
        self._timer: Timer | None = None

    def begin(self, execution_id: str) -> None:
        self._open[execution_id] = None
        if self._timer is None:
            self._timer = self._managers.after(self._period_s, self._report)

    def end(self, execution_id: str) -> None:
        self._open.pop(execution_id, None)
        if not self._open and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _report(self) -> None:
        self._timer = self._managers.after(self._period_s, self._report)
        for execution_id in list(self._open):
            self._managers.report(execution_id)
