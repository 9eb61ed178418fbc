"""Runs one skillset: takes the steps of ``semantics`` one after another and calls the hooks between them.

The engine is a front of several parts that share a ``Floor``: requests (here), ``Stops`` (interruption and emergency) and
``Pauses``; ``why`` answers questions. A hook may end, interrupt or start whatever it likes, from any thread.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from skill_language.model import Skillset
from skill_runtime.core import semantics
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import Listener
from skill_runtime.core.execution import Execution, ExecutionState
from skill_runtime.core.floor import Floor, Job
from skill_runtime.core.hook_calls import HookAnswer, HookCaller, LocalHooks
from skill_runtime.core.ledger import Entry, ResourceStatus
from skill_runtime.core.pauses import PauseReply, Pauses, Reply
from skill_runtime.core.records import SkillRecord
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


def run_at_once(job: Job) -> None:
    """Run a job in the calling thread."""
    job()


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
        UnsupportedModelError: the model can't be executed.
        SkillRuntimeError: a skill has no hooks, or hooks have no skill.
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
        semantics.check_supported(skillset)
        self.skillset = skillset
        self._hooks: HookCaller = LocalHooks(skillset, hooks) if isinstance(hooks, Mapping) else hooks
        self._data_names = tuple(data.name for data in skillset.data)
        self._floor = Floor(skillset, clock_ns, self._hooks, listener, defer=defer, on_error=on_error)
        self._lock = self._floor.lock
        self._ledger = self._floor.ledger
        self._stops = Stops(self._floor, interrupt_timeout_s)
        self._pauses = Pauses(self._floor, self._stops)

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
        self.skillset.skill(skill)
        with self._lock:
            execution_id = execution_id or str(self._ledger.sequence + 1)
            if execution_id in self._ledger.entries:
                raise SkillRuntimeError(f"skill {skill}: the execution id {execution_id} is in use")
            entry = self._ledger.add(Execution(self, execution_id, skill, inputs))
            if self._floor.closed:
                self._ledger.end_request(entry, ExecutionState.NOT_VALIDATED, self._floor.closed)
        self._floor.deliver()
        return entry.execution

    def run(self, execution_id: str, submit: Callable[[Job], None] = run_at_once) -> None:
        """Have a registered request validated and started, unless it has ended meanwhile.

        ``submit`` runs ``validate`` and ``on_dispatch``, which may wait, where somebody wrote them; all else is done in this thread.
        """
        with self._lock:
            entry = self._ledger.entries.get(execution_id)
            if entry is None or entry.execution.state is not ExecutionState.REQUESTED:
                return
        if self._hooks.written(entry.execution.skill, "validate"):
            validated = lambda refusal: self._validated(entry, str(refusal or ""), run_at_once)  # noqa: E731
            submit(lambda: self._floor.call(entry, "validate", validated))
        else:
            self._validated(entry, "", submit)

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
        with self._lock:
            entry = self._ledger.running(execution_id)
            if entry is None:
                return False
            unknown = self._unknown_output(entry, values)
            if unknown:
                step = semantics.fail(self.skillset, self._ledger.situation, entry.key, unknown)
            else:
                entry.execution.outputs.update(values)
                step = semantics.terminate(self.skillset, self._ledger.situation, entry.key, result, message)
            stops = self._ledger.commit(step, by_itself=entry)
        self._floor.after_step(stops)
        return True

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED; False when it has ended or is not known."""
        self.tick()
        return self._floor.fail(execution_id, message)

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution; unknown names end it as FAILED."""
        values = dict(outputs)
        with self._lock:
            entry = self._ledger.running(execution_id)
            if entry is None:
                return
            unknown = self._unknown_output(entry, values)
            if not unknown:
                entry.execution.outputs.update(values)
        if unknown:
            self.fail(execution_id, unknown)

    def progress(self, execution_id: str) -> float | None:
        """Ask the ``progress`` hook; return its answer within 0 to 1, or None when the execution is not running.

        Only a RUNNING one is asked; one that is PAUSED or INTERRUPTING has the progress that it had, and hooks elsewhere tell
        theirs by ``report_progress``. An answer that differs from the one before is progress, which puts off the progress deadline.
        """
        self.tick()
        with self._lock:
            entry = self._ledger.running(execution_id)
            if entry is None:
                return None
            execution = entry.execution
            if entry.dispatching or entry.stop_hook or execution.state is not ExecutionState.RUNNING:
                return execution.progress
        answers: list[object] = []
        self._floor.call(entry, "progress", answers.append)
        if not answers or answers[0] is None:
            return None if execution.done else execution.progress
        return self.report_progress(execution_id, answers[0])

    def report_progress(self, execution_id: str, value: object) -> float | None:
        """Keep an execution's progress, held within 0 to 1; what is no number ends it as FAILED."""
        try:
            told = min(1.0, max(0.0, float(value)))  # type: ignore[arg-type]  # that is tried
        except (TypeError, ValueError) as error:
            self.fail(execution_id, f"progress raised {type(error).__name__}: {error}")
            return None
        with self._lock:
            entry = self._ledger.running(execution_id)
            if entry is None:
                return None
            if told != entry.execution.progress and entry.execution.state is ExecutionState.RUNNING:
                self._ledger.progressed(entry)
            entry.execution.progress = told
        return told

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

        self._hooks.call(Execution(self, "", skill, inputs), "validate", answered)

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

    def _validated(self, entry: Entry, refusal: str, submit: Callable[[Job], None]) -> None:
        """Refuse the request or take its start step and call ``on_dispatch``."""
        self.tick()
        started = False
        stops: list[Entry] = []
        with self._lock:
            if entry.execution.done:
                return
            if refusal:
                self._ledger.end_request(entry, ExecutionState.NOT_VALIDATED, refusal)
            else:
                stops, started = self._start(entry)
        self._floor.after_step([other for other in stops if other is not entry])
        if started and self._hooks.written(entry.execution.skill, "on_dispatch"):
            submit(lambda: self._floor.call(entry, "on_dispatch", lambda _: self._stops.hook_returned(entry)))

    def _start(self, entry: Entry) -> tuple[list[Entry], bool]:
        """Take the start step with the lock held; return what is to be stopped, and whether the execution runs."""
        entry.dispatching = self._hooks.written(entry.execution.skill, "on_dispatch")
        stops = self._ledger.commit(semantics.start(self.skillset, self._ledger.situation, entry.key))
        started = entry.execution.state is ExecutionState.RUNNING
        if not started:
            # Also when its own invariant broke in the very step: nothing was dispatched, nothing is to be stopped.
            self._ledger.entries.pop(entry.key.id, None)
        return stops, started

    def _paused(self, execution_id: str, *, paused: bool) -> PauseReply:
        self.tick()
        replies: list[PauseReply] = []
        self._pauses.set_paused(execution_id, paused=paused, reply=replies.append, wait=False)
        return replies[0]

    def _unknown_output(self, entry: Entry, outputs: Mapping[str, object]) -> str:
        """Return what is wrong with the names of outputs, or ""."""
        known = [output.name for output in self.skillset.skill(entry.execution.skill).outputs]
        unknown = [name for name in outputs if name not in known]
        if not unknown:
            return ""
        return f"skill {entry.execution.skill} has no output {', '.join(unknown)}; it has {', '.join(known) or 'none'}"
