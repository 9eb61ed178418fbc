"""Runs one skillset: takes the steps of ``semantics`` one after another and calls the hooks between them.

The engine is a front of several parts that share a ``Floor``: ``Requests``, ``Reports`` of the functions, ``Stops`` (interruption
and emergency) and ``Pauses``; ``why`` answers questions. A hook may end, interrupt or start whatever it likes, from any thread.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from skill_model import semantics
from skill_model.errors import UnsupportedModelError
from skill_model.model import Skillset
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import Listener
from skill_runtime.core.execution import Execution
from skill_runtime.core.floor import Floor, Job
from skill_runtime.core.hook_calls import HookAnswer, HookCaller, LocalHooks
from skill_runtime.core.ledger import ResourceStatus
from skill_runtime.core.pauses import PauseReply, Pauses, Reply
from skill_runtime.core.records import SkillRecord
from skill_runtime.core.reports import Reports
from skill_runtime.core.requests import Requests, Submit, run_at_once
from skill_runtime.core.stops import DEFAULT_TIMEOUT_S, Stops
from skill_runtime.core.why import Why, resources_of, sentence, unmet
from skill_runtime.hooks import SkillHooks

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class TransitionReply:
    """Answer to an extern transition or an event.

    ``state`` is the resource's state afterwards, empty for an event and when there is no such resource.
    """

    accepted: bool
    reason: str
    state: str


def log_error(text: str) -> None:
    """Tell of an error that has no execution to end."""
    _LOG.error(text)


class SkillsetEngine:
    """The managers of one skillset without ROS: resources, executions, hooks.

    Args:
        skillset: the model.
        clock_ns: the mission clock, nanoseconds.
        hooks: one a skill, or whoever calls them elsewhere.
        listener: gets the events of each step.
        defer: runs a stop hook that a step of somebody else has made necessary; by default in the thread of that step. It
            should not wait for other hooks: emergencies come this way.
        on_error: gets one text for each error that no execution can carry.
        interrupt_timeout_s: how long a stop may take where the model does not say.

    Raises:
        SkillRuntimeError: the model can't be executed, a skill has no hooks, or hooks have no skill.
    """

    def __init__(
        self,
        skillset: Skillset,
        clock_ns: Callable[[], int],
        hooks: Mapping[str, SkillHooks] | HookCaller,
        listener: Listener,
        *,
        defer: Callable[[Job], None] = run_at_once,
        on_error: Callable[[str], None] = log_error,
        interrupt_timeout_s: float = DEFAULT_TIMEOUT_S,
    ) -> None:
        try:
            semantics.check_supported(skillset)
        except UnsupportedModelError as error:
            raise SkillRuntimeError(str(error)) from error
        self.skillset = skillset
        self._data_names = tuple(data.name for data in skillset.data)
        caller: HookCaller = LocalHooks(skillset, hooks) if isinstance(hooks, Mapping) else hooks
        self._floor = Floor(skillset, clock_ns, caller, listener, defer=defer, on_error=on_error)
        self._lock = self._floor.lock
        self._ledger = self._floor.ledger
        self._stops = Stops(self._floor, interrupt_timeout_s)
        self._pauses = Pauses(self._floor, self._stops)
        self._requests = Requests(self._floor, self._stops, self, self.tick)
        self._reports = Reports(self._floor, self.fail)

    # --- what others ask for -----------------------------------------------------------------------------------------

    def request(self, skill: str, inputs: object, *, execution_id: str = "") -> Execution:
        """Ask for a skill; return when it has ended or its ``on_dispatch`` has returned (hooks elsewhere: at once).

        Several executions of one skill may run if its preconditions allow; ``execution_id`` (default: counted) must be
        unused among those that have not ended.

        Raises:
            KeyError: there is no such skill.
            SkillRuntimeError: the id is in use.
        """
        execution = self.register(skill, inputs, execution_id=execution_id)
        self.run(execution.id)
        return execution

    def register(self, skill: str, inputs: object, *, execution_id: str = "") -> Execution:
        """Take down a request without calling a hook, so that it can be interrupted; ``run`` has to follow. Raises as ``request``."""
        return self._requests.register(skill, inputs, execution_id)

    def run(self, execution_id: str, submit: Submit = run_at_once) -> None:
        """Have a registered request validated and started, unless it has ended meanwhile.

        ``submit`` runs ``validate`` and ``on_dispatch``, which may wait, where somebody wrote them; all else is done in this thread.
        """
        self._requests.run(execution_id, submit)

    def transition(self, resource: str, to: str) -> TransitionReply:
        """Take an extern transition, or say why not."""
        self.tick()
        with self._lock:
            reason = semantics.extern_refusal(self.skillset, self._ledger.situation, resource, to)
            stops = [] if reason else self._ledger.commit(semantics.transition(self.skillset, self._ledger.situation, resource, to))
            reply = TransitionReply(not reason, reason, self._ledger.situation.states.get(resource, ""))
        self._floor.after_step(stops)
        return reply

    def trigger(self, event: str) -> TransitionReply:
        """Take an event of the model, or say why not: its guard is false, or its effect is no transition now."""
        self.tick()
        with self._lock:
            reason = semantics.event_refusal(self.skillset, self._ledger.situation, event)
            stops = [] if reason else self._ledger.commit(semantics.event(self.skillset, self._ledger.situation, event))
        self._floor.after_step(stops)
        return TransitionReply(not reason, reason, "")

    def update_data(self, name: str, value: object | None) -> None:
        """Take a fresh value of a data, or None: there is no fresh one any more. What that breaks is ended in the same step.

        Raises:
            SkillRuntimeError: there is no such data.
        """
        if name not in self._data_names:
            raise SkillRuntimeError(f"skillset {self.skillset.name} has no data {name}; it has {', '.join(self._data_names) or 'none'}")
        self.tick()
        with self._lock:
            stops = self._ledger.commit(semantics.receive(self.skillset, self._ledger.situation, name, value))
        self._floor.after_step(stops)

    def interrupt(self, execution_id: str) -> bool:
        """Ask for the end of an execution: ``on_interrupt``, then the step (see ``stops``). False when it has ended or is not known.

        While ``validate`` runs, it ends at once and never starts; while ``on_dispatch`` runs, the hook follows after it.
        """
        self.tick()
        return self._stops.interrupt(execution_id)

    def interrupted(self, execution_id: str, message: str = "") -> bool:
        """Say that the stop which ``on_interrupt`` has begun is done; False when none is under way."""
        self.tick()
        return self._stops.interrupted(execution_id, message)

    def set_paused(self, execution_id: str, reply: Reply, *, paused: bool) -> None:
        """Pause or resume an execution; ``reply`` gets the answer once the hook has given it."""
        self.tick()
        self._pauses.set_paused(execution_id, paused=paused, reply=reply)

    def pause(self, execution_id: str) -> PauseReply:
        """Pause an execution whose hooks are in this process."""
        return self._paused(execution_id, paused=True)

    def resume(self, execution_id: str) -> PauseReply:
        """Resume an execution whose hooks are in this process."""
        return self._paused(execution_id, paused=False)

    def terminate(self, execution_id: str, result: str, message: str = "", outputs: Mapping[str, object] | None = None) -> bool:
        """End a running execution with a result of the model; False when it is not running (any more)."""
        values = dict(outputs or {})
        self.tick()
        return self._reports.terminate(execution_id, result, message, values)

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED; False when it has ended or is not known."""
        self.tick()
        return self._floor.fail(execution_id, message)

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution; unknown names end it as FAILED."""
        self._reports.set_outputs(execution_id, dict(outputs))

    def progress(self, execution_id: str) -> float | None:
        """Ask the ``progress`` hook; return its answer within 0 to 1, or None when the execution is not running.

        Only a RUNNING one is asked; one that is PAUSED or INTERRUPTING has the progress that it had, and hooks elsewhere tell
        theirs by ``report_progress``. An answer that differs from the one before is progress, which puts off the progress deadline.
        """
        self.tick()
        return self._reports.ask_progress(execution_id)

    def report_progress(self, execution_id: str, value: object) -> float | None:
        """Keep an execution's progress, held within 0 to 1; what is no number ends it as FAILED."""
        return self._reports.set_progress(execution_id, value)

    def fail_all(self, message: str) -> None:
        """End whatever was asked for or runs as FAILED."""
        for execution in self.executions:
            self.fail(execution.id, message)

    def close(self, message: str) -> None:
        """Fail whatever runs, for ``message``, and refuse all later requests for the same reason."""
        with self._lock:
            self._floor.closed = message
        self.fail_all(message)

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def due_ns(self) -> int | None:
        """Return when, on the mission clock, time alone may next change something: then ``tick`` is to be called."""
        with self._lock:
            return min((due for due in (self._ledger.due_ns, self._stops.due_ns()) if due is not None), default=None)

    def tick(self) -> None:
        """Do what has become due: a duration that has run out, a progress deadline, a stop that is too late.

        Every other step begins with it, so that a late call makes the step late, not another one.
        """
        self._floor.elapse()
        self._stops.tick()

    # --- questions ---------------------------------------------------------------------------------------------------

    @property
    def resources(self) -> dict[str, ResourceStatus]:
        """Return all resources at one moment."""
        with self._lock:
            return dict(self._ledger.resources)

    @property
    def executions(self) -> tuple[Execution, ...]:
        """Return those that have not ended."""
        with self._lock:
            return tuple(entry.execution for entry in self._ledger.entries.values() if not entry.execution.done)

    def execution(self, execution_id: str) -> Execution | None:
        """Return one that has not ended, or None."""
        with self._lock:
            entry = self._ledger.entries.get(execution_id)
        return None if entry is None or entry.execution.done else entry.execution

    @property
    def skills(self) -> dict[str, SkillRecord]:
        """Return each skill's open executions and the one that ended last."""
        with self._lock:
            return dict(self._floor.records.skills)

    def why(self, skill: str, inputs: object = None) -> Why:
        """Tell whether a skill could start now, and if not, why; with inputs ``validate`` is asked, too (hooks in this process).

        Raises:
            KeyError: there is no such skill.
        """
        refusals: list[str] = []
        if inputs is not None:
            self.ask_validate(skill, inputs, refusals.append)
        return self.explain(skill, refusals[0] if refusals else "")

    def ask_validate(self, skill: str, inputs: object, then: Callable[[str], None]) -> None:
        """Ask ``validate`` without an execution; ``then`` gets its refusal or "", once, perhaps later."""

        def answered(answer: HookAnswer) -> None:
            then(f"validate raised {answer.error}" if answer.error else str(answer.value or ""))

        self._floor.hooks.call(Execution(self, "", skill, inputs), "validate", answered)

    def explain(self, skill: str, refusal: str = "") -> Why:
        """Answer as ``why``, with what ``validate`` has said already."""
        model = self.skillset.skill(skill)
        self.tick()
        with self._lock:
            found = unmet(self.skillset, self._ledger.situation, model)
            history = self._floor.records.history(resources_of(model))
            reason = sentence(found, refusal, self._floor.closed)
        return Why(skill, not reason, reason, refusal, found, history)

    # --- parts -------------------------------------------------------------------------------------------------------

    def _paused(self, execution_id: str, *, paused: bool) -> PauseReply:
        self.tick()
        replies: list[PauseReply] = []
        self._pauses.set_paused(execution_id, paused=paused, reply=replies.append, wait=False)
        return replies[0]
