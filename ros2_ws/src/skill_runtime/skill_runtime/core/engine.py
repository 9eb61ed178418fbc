"""Runs one skillset: takes the steps of ``semantics`` one after another and calls the hooks between them.

All changes go through one lock; hooks and the listener are never called while it is held, so a hook may end, interrupt
or start whatever it likes. Events are queued under the lock, so in the order of the steps, and delivered without it.
"""

from __future__ import annotations

import functools
import logging
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from skill_language.model import Skillset
from skill_runtime.core import semantics
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import Listener
from skill_runtime.core.execution import Execution, ExecutionState
from skill_runtime.core.ledger import Entry, Ledger, ResourceStatus
from skill_runtime.core.outbox import Outbox
from skill_runtime.hooks import SkillHooks

_LOG = logging.getLogger(__name__)
Job = Callable[[], None]


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
        hooks: one a skill.
        listener: gets the events of each step.
        defer: runs a stop hook that a step of somebody else has made necessary; by default in the thread of that step.
        on_error: gets one text for each error that no execution can carry.

    Raises:
        UnsupportedModelError: the model can't be executed.
        SkillRuntimeError: a skill has no hooks, or hooks have no skill.
    """

    def __init__(
        self,
        skillset: Skillset,
        clock_ns: Callable[[], int],
        hooks: Mapping[str, SkillHooks],
        listener: Listener,
        *,
        defer: Callable[[Job], None] = run_at_once,
        on_error: Callable[[str], None] = log_error,
    ) -> None:
        semantics.check_supported(skillset)
        _check_hooks(skillset, hooks)
        self.skillset = skillset
        self._hooks = dict(hooks)
        self._data_names = tuple(data.name for data in skillset.data)
        self._defer = defer
        self._on_error = on_error
        self._lock = threading.Lock()
        self._outbox = Outbox(listener, on_error)
        self._ledger = Ledger(skillset, clock_ns, self._outbox.put)
        self._closed = ""

    # --- what others ask for -----------------------------------------------------------------------------------------

    def request(self, skill: str, inputs: object, *, execution_id: str = "") -> Execution:
        """Ask for a skill; return when it has ended or its ``on_dispatch`` has returned.

        Several executions of one skill may run if its preconditions allow; ``execution_id`` (default: counted) must be
        unused among those that have not ended.

        Raises:
            KeyError: there is no such skill.
            SkillRuntimeError: the id is in use.
        """
        self.skillset.skill(skill)
        entry = self._register(skill, inputs, execution_id)
        self._outbox.deliver()
        if self._validated(entry):
            self._start(entry)
        return entry.execution

    def transition(self, resource: str, to: str) -> TransitionReply:
        """Take an extern transition, or say why not."""
        self.tick()
        with self._lock:
            reason = semantics.extern_refusal(self.skillset, self._ledger.situation, resource, to)
            stops = [] if reason else self._ledger.commit(semantics.transition(self.skillset, self._ledger.situation, resource, to))
            reply = TransitionReply(not reason, reason, self._ledger.situation.states.get(resource, ""))
        self._after_step(stops)
        return reply

    def trigger(self, event: str) -> TransitionReply:
        """Take an event of the model, or say why not: its guard is false, or its effect is no transition now."""
        self.tick()
        with self._lock:
            reason = semantics.event_refusal(self.skillset, self._ledger.situation, event)
            stops = [] if reason else self._ledger.commit(semantics.event(self.skillset, self._ledger.situation, event))
        self._after_step(stops)
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
        self._after_step(stops)

    @property
    def due_ns(self) -> int | None:
        """Return when, on the mission clock, time alone may next change something: then ``tick`` is to be called."""
        with self._lock:
            return self._ledger.due_ns

    def tick(self) -> None:
        """Take the step of what has become due: a duration that has run out, a progress deadline.

        Every other step begins with it, so that a late call makes the step late, not another one.
        """
        with self._lock:
            due_ns = self._ledger.due_ns
            if due_ns is None or (situation := self._ledger.situation).now_ns < due_ns:
                return
            stops = self._ledger.commit(semantics.elapse(self.skillset, situation))
        self._after_step(stops)

    def interrupt(self, execution_id: str) -> bool:
        """Interrupt an execution: ``on_interrupt``, then the step. False when it has ended or is not known.

        While ``validate`` runs, it ends at once and never starts; while ``on_dispatch`` runs, the rest follows after it.
        """
        self.tick()
        with self._lock:
            entry = self._ledger.entries.get(execution_id)
            if entry is None or entry.execution.done:
                return False
            requested = entry.execution.state is ExecutionState.REQUESTED
            now = not (requested or entry.dispatching or entry.stop_hook)
            if requested:
                self._ledger.end_request(entry, ExecutionState.INTERRUPTED, "interrupted before it started")
            elif not entry.stop_hook:
                entry.stop_hook = "on_interrupt"
                self._ledger.interrupting(entry)
        self._outbox.deliver()
        if now:
            self._stop(entry)
        return True

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
        self._after_step(stops)
        return True

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED; False when it has ended or is not known."""
        self.tick()
        with self._lock:
            entry = self._ledger.entries.get(execution_id)
            if entry is None or entry.execution.done:
                return False
            stops: list[Entry] = []
            if entry.execution.state is ExecutionState.REQUESTED:
                self._ledger.end_request(entry, ExecutionState.FAILED, message)
            else:
                stops = self._ledger.commit(semantics.fail(self.skillset, self._ledger.situation, entry.key, message))
        self._after_step(stops)
        return True

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

        An answer that differs from the one before is progress, which puts off the progress deadline.
        """
        self.tick()
        with self._lock:
            entry = self._ledger.running(execution_id)
            if entry is None:
                return None
            execution = entry.execution
            if entry.dispatching or entry.stop_hook:
                return execution.progress
        try:
            value = min(1.0, max(0.0, float(self._hooks[execution.skill].progress(execution))))
        except Exception as error:  # noqa: BLE001 - whatever a hook raises ends its execution only
            self._hook_raised(entry, "progress", error)
            return None
        with self._lock:
            if value != execution.progress and not execution.done and not entry.stop_hook:
                self._ledger.progressed(entry)
            execution.progress = value
        return None if execution.done else value

    def fail_all(self, message: str) -> None:
        """End whatever was asked for or runs as FAILED."""
        for execution in self.executions:
            self.fail(execution.id, message)

    def close(self, message: str) -> None:
        """Fail whatever runs, for ``message``, and refuse all later requests for the same reason."""
        with self._lock:
            self._closed = message
        self.fail_all(message)

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

    # --- a request's way ---------------------------------------------------------------------------------------------

    def _register(self, skill: str, inputs: object, execution_id: str) -> Entry:
        with self._lock:
            execution_id = execution_id or str(self._ledger.sequence + 1)
            if execution_id in self._ledger.entries:
                raise SkillRuntimeError(f"skill {skill}: the execution id {execution_id} is in use")
            entry = self._ledger.add(Execution(self, execution_id, skill, inputs))
            if self._closed:
                self._ledger.end_request(entry, ExecutionState.NOT_VALIDATED, self._closed)
        return entry

    def _validated(self, entry: Entry) -> bool:
        """Call ``validate``; tell whether the request is still on."""
        if entry.execution.done:
            return False
        try:
            refusal = self._hooks[entry.execution.skill].validate(entry.execution.inputs)
        except Exception as error:  # noqa: BLE001 - as in progress
            self._hook_raised(entry, "validate", error)
            return False
        if refusal:
            with self._lock:
                if not entry.execution.done:
                    self._ledger.end_request(entry, ExecutionState.NOT_VALIDATED, str(refusal))
            self._outbox.deliver()
        return not entry.execution.done

    def _start(self, entry: Entry) -> None:
        """Take the start step and call ``on_dispatch``; then what was asked for meanwhile."""
        self.tick()
        with self._lock:
            if entry.execution.done:
                return
            entry.dispatching = True
            stops = self._ledger.commit(semantics.start(self.skillset, self._ledger.situation, entry.key))
            started = entry.execution.state is ExecutionState.RUNNING
            if not started:
                # Also when its own invariant broke in the very step: nothing was dispatched, nothing is to be stopped.
                self._ledger.entries.pop(entry.key.id, None)
        self._after_step([other for other in stops if other is not entry])
        if started:
            self._call(entry, "on_dispatch")
            with self._lock:
                entry.dispatching = False
                stop = bool(entry.stop_hook) and entry.execution.state is not ExecutionState.TERMINATED
                self._ledger.forget_if_through(entry)
            if stop:
                self._stop(entry)

    def _stop(self, entry: Entry) -> None:
        """Call the decided stop hook; after ``on_interrupt`` take the step of the interruption."""
        self._call(entry, entry.stop_hook)
        with self._lock:
            stops: list[Entry] = []
            if entry.execution.state is ExecutionState.RUNNING:
                stops = self._ledger.commit(semantics.interrupt(self.skillset, self._ledger.situation, entry.key), by_itself=entry)
        self._after_step(stops)

    # --- hooks -------------------------------------------------------------------------------------------------------

    def _call(self, entry: Entry, name: str) -> None:
        hooks = self._hooks[entry.execution.skill]
        try:
            getattr(hooks, name)(entry.execution)
        except Exception as error:  # noqa: BLE001 - as in progress
            self._hook_raised(entry, name, error)

    def _hook_raised(self, entry: Entry, hook: str, error: Exception) -> None:
        """End the execution as FAILED with the last line of the traceback."""
        last_line = "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
        self._on_error(f"{entry.execution}: {hook} raised\n{''.join(traceback.format_exception(error))}")
        self.fail(entry.key.id, f"{hook} raised {last_line}")

    # --- parts -------------------------------------------------------------------------------------------------------

    def _unknown_output(self, entry: Entry, outputs: Mapping[str, object]) -> str:
        """Return what is wrong with the names of outputs, or ""."""
        known = [output.name for output in self.skillset.skill(entry.execution.skill).outputs]
        unknown = [name for name in outputs if name not in known]
        if not unknown:
            return ""
        return f"skill {entry.execution.skill} has no output {', '.join(unknown)}; it has {', '.join(known) or 'none'}"

    def _after_step(self, stops: list[Entry]) -> None:
        """Deliver events, then have the functions of executions that were ended stopped; called without the lock."""
        self._outbox.deliver()
        for entry in stops:
            self._defer(functools.partial(self._call, entry, entry.stop_hook))


def _check_hooks(skillset: Skillset, hooks: Mapping[str, SkillHooks]) -> None:
    skills = [skill.name for skill in skillset.skills]
    missing = [name for name in skills if name not in hooks]
    surplus = [name for name in hooks if name not in skills]
    if missing:
        raise SkillRuntimeError(f"skillset {skillset.name}: no hooks for {', '.join(missing)}; the hooks factory must return one a skill")
    if surplus:
        raise SkillRuntimeError(f"skillset {skillset.name} has no skill {', '.join(surplus)}; it has {', '.join(skills)}")
