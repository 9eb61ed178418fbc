"""Runs one skillset: takes the steps of ``semantics`` one after another and calls the hooks between them.

All changes of the execution context go through one lock; hooks and the listener are never called while it is held, so a hook may
end, interrupt or start any execution, from any thread. Events are queued under the lock, so in the order of the steps.

The stop contract: an interruption is asked for, then done; when that takes too long, it is an emergency. Asked: the execution is
INTERRUPTING (its resources are still held, it may still end by a result or a violation), and ``on_interrupt`` is called, after
``on_dispatch`` if that has not returned. Done: the interrupt effect is applied, as soon as ``on_interrupt`` returns, or, when it
returns False, as soon as ``execution.interrupted()`` is called. Too late: ``on_emergency`` is called, whatever other hook still
waits, and the execution ends INTERRUPTED with its effect and a message that says so.

Hooks are watched (see ``watchdog``): one that does not return ends its execution as FAILED, and the function is stopped by
``on_emergency`` where another hook that should stop it would have to wait for the one that hangs.
"""

from __future__ import annotations

import functools
import logging
import threading
from collections.abc import Callable, Mapping, Sequence

from alula.model import semantics
from alula.model.errors import UnsupportedModelError
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.model.situation import Running
from alula.runtime.core.context import Entry, SkillsetContext
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import Listener
from alula.runtime.core.execution import Execution
from alula.runtime.core.hook_calls import HookCaller, HookOutcome, LocalHooks, Then
from alula.runtime.core.outbox import Outbox
from alula.runtime.core.records import ResourceStatus, SkillRecord
from alula.runtime.core.replies import PauseReply, TransitionReply
from alula.runtime.core.sanitize import as_text, fitted_outputs
from alula.runtime.core.watchdog import WATCHDOG
from alula.runtime.core.why import Why, resources_of, sentence, unmet
from alula.runtime.hooks import SkillHooks

_LOG = logging.getLogger(__name__)

Job = Callable[[], None]
Submit = Callable[[Job], None]

DEFAULT_TIMEOUT_S = 5.0
"""How long a stop may take where the model does not say, mission clock."""
HOOK_TIMEOUT_S = 10.0
"""How long a hook may take to return, in time that this process could run."""
_STARTS = frozenset({"on_dispatch", "on_pause", "on_resume"})
"""No hook that stops the function overtakes these, but ``on_emergency``."""
_STOPS = frozenset({"on_violation", "on_failure"})


Reply = Callable[[PauseReply], None]


def run_at_once(job: Job) -> None:
    """Run a job in the calling thread."""
    job()


def log_error(text: str) -> None:
    """Log an error that belongs to no execution."""
    _LOG.error(text)


def _nothing(_: object) -> None:
    """Ignore what a call came to."""


class SkillsetEngine:
    """The managers of one skillset without ROS: resources, executions, hooks.

    Args:
        skillset: the model.
        clock_ns: the mission clock, nanoseconds.
        hooks: one a skill, or the caller of hooks that are elsewhere.
        listener: gets the events of each step.
        instance_id: of the managers, for the events.
        defer: runs a stop hook that a step of another caller has made necessary; by default in the thread of that step. It
            should not wait for other hooks: emergencies come this way.
        on_error: gets one text for each error that no execution can carry.
        interrupt_timeout_s: how long a stop may take where the model does not say, mission clock.
        hook_timeout_s: how long a hook may take to return, in time that this process could run; None for ever.

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
        instance_id: str = "",
        defer: Submit = run_at_once,
        on_error: Callable[[str], None] = log_error,
        interrupt_timeout_s: float = DEFAULT_TIMEOUT_S,
        hook_timeout_s: float | None = HOOK_TIMEOUT_S,
    ) -> None:
        try:
            semantics.check_supported(skillset)
        except UnsupportedModelError as error:
            raise SkillRuntimeError(str(error)) from error
        self.skillset = skillset
        self._asked_data = semantics.asked_data(skillset)
        self._clock_ns = clock_ns
        self._hooks: HookCaller = LocalHooks(skillset, hooks) if isinstance(hooks, Mapping) else hooks
        self._defer = defer
        self._on_error = on_error
        self._interrupt_timeout_s = interrupt_timeout_s
        self._hook_timeout_s = hook_timeout_s
        self._closed = ""
        self._starting: set[str] = set()
        """Skills whose ``on_start`` has not returned."""
        self._begun = False
        """Whether all have once returned: until then no skill takes a request, afterwards only those that start anew do not."""
        self._unstarted: dict[str, str] = {}
        """Why skills whose ``on_start`` went wrong take no requests."""
        self._lock = threading.Lock()
        self._outbox = Outbox(listener, on_error)
        self._context = SkillsetContext(skillset, clock_ns, self._outbox.put, instance_id)

    # --- the start: what managers that were here before have left running ---------------------------------------------------

    @property
    def skills_to_start(self) -> tuple[str, ...]:
        """Return the skills whose ``on_start`` does anything."""
        return tuple(skill.name for skill in self.skillset.skills if self._hooks.written(skill.name, "on_start"))

    def start(self, skills: Sequence[str], submit: Submit, then: Job) -> None:
        """Call the ``on_start`` of these skills by ``submit``, all beside each other; ``then`` is called once, when all have returned.

        At the first time, no skill takes a request meanwhile: functions that are yet to be stopped may hold any resource. Later, when the
        process of one skill was started again, the others go on.
        """
        left = set(skills)
        with self._lock:
            self._starting |= left
            self._begun |= not left

        def started(name: str, answer: HookOutcome) -> None:
            with self._lock:
                self._unstarted.pop(name, None)
                if answer.error:
                    self._unstarted[name] = f"{name} could not stop what ran of it before: {answer.error}; start the managers again"
                self._starting.discard(name)
                left.discard(name)
                last = not left
                self._begun |= last
            if last:
                then()

        def call(name: str) -> None:
            if self._hooks.written(name, "on_start"):
                self._call(Entry(Execution(self, "", name, None), Running("", name)), "on_start", functools.partial(started, name))
            else:
                started(name, HookOutcome())

        for name in skills:
            submit(functools.partial(call, name))
        if not skills:
            then()

    def _refusal(self, skill: str) -> str:
        """Return why no request for a skill is taken now, or ""; called with the lock held."""
        awaited = self._starting & {skill} if self._begun else self._starting
        starting = f"what ran before has yet to be stopped: {', '.join(sorted(awaited))}" if awaited else ""
        return self._closed or starting or self._unstarted.get(skill, "")

    # --- requests: validated, started in one step, dispatched (paper, Figure 5) --------------------------------------------

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
        """Register a request without calling a hook, so that it can be interrupted; ``run`` has to follow. Raises as ``request``."""
        self.skillset.skill(skill)
        with self._lock:
            execution_id = execution_id or str(self._context.sequence + 1)
            if execution_id in self._context.entries:
                raise SkillRuntimeError(f"skill {skill}: the execution id {execution_id} is in use")
            entry = self._context.add(Execution(self, execution_id, skill, inputs))
            if refusal := self._refusal(skill):
                self._context.end_request(entry, ExecutionState.NOT_VALIDATED, refusal)
        self._outbox.deliver()
        return entry.execution

    def run(self, execution_id: str, submit: Submit = run_at_once) -> None:
        """Validate and start a registered request, unless it has ended meanwhile.

        ``submit`` runs ``validate`` and ``on_dispatch``, which may wait, where they are overridden; all else runs in this thread.
        """
        with self._lock:
            entry = self._context.open(execution_id)
        if entry is None or entry.execution.state is not ExecutionState.REQUESTED:
            return
        if self._hooks.written(entry.execution.skill, "validate"):
            validated = lambda answer: self._start(entry, answer, run_at_once)  # noqa: E731
            submit(lambda: self._call(entry, "validate", validated))
        else:
            self._start(entry, HookOutcome(""), submit)

    def _start(self, entry: Entry, validated: HookOutcome, submit: Submit) -> None:
        """Refuse the request or take its start step and call ``on_dispatch``."""
        self.tick()
        refusal = str(validated.value or "")
        dispatch = self._hooks.written(entry.execution.skill, "on_dispatch")
        stops: list[Entry] = []
        with self._lock:
            if entry.execution.done:
                return
            if refusal:
                self._context.end_request(entry, ExecutionState.NOT_VALIDATED, refusal)
            else:
                entry.dispatching = dispatch
                stops = self._context.commit(semantics.start(self.skillset, self._context.situation, entry.key))
            started = entry.execution.state is ExecutionState.RUNNING
            if not started:
                # Also when its own invariant broke in the very step: nothing was dispatched, nothing is to be stopped.
                self._context.entries.pop(entry.key.id, None)
        self._after_step([other for other in stops if other is not entry])
        if started and dispatch:
            submit(lambda: self._call(entry, "on_dispatch"))

    # --- reports of the functional layer -----------------------------------------------------------------------------------

    def transition(self, resource: str, to: str, reason: str = "") -> TransitionReply:
        """Take an extern transition, or say why not; ``reason``: why the resource changes, in words."""
        self.tick()
        with self._lock:
            situation = self._context.situation
            refusal = semantics.extern_refusal(self.skillset, situation, resource, to)
            stops = [] if refusal else self._context.commit(semantics.transition(self.skillset, situation, resource, to, as_text(reason)))
            reply = TransitionReply(not refusal, refusal, self._context.situation.states.get(resource, ""))
        self._after_step(stops)
        return reply

    def note(self, resource: str, state: str, reason: str) -> None:
        """Take another reason for the state that a resource is in; where it is in another one by now, nothing."""
        with self._lock:
            self._context.note(resource, state, reason)

    def trigger(self, event: str) -> TransitionReply:
        """Take an event of the model, or say why not: its guard is false, or its effect is no transition now."""
        self.tick()
        with self._lock:
            situation = self._context.situation
            reason = semantics.event_refusal(self.skillset, situation, event)
            stops = [] if reason else self._context.commit(semantics.event(self.skillset, situation, event))
        self._after_step(stops)
        return TransitionReply(not reason, reason, "")

    def update_data(self, name: str, value: object | None) -> None:
        """Take a fresh value of a data, or None: there is no fresh one any more. What that breaks is ended in the same step.

        Raises:
            SkillRuntimeError: there is no such data.
        """
        known = [data.name for data in self.skillset.data]
        if name not in known:
            raise SkillRuntimeError(f"skillset {self.skillset.name} has no data {name}; it has {', '.join(known) or 'none'}")
        self.tick()
        if name not in self._asked_data:
            return
        with self._lock:
            stops = self._context.commit(semantics.receive(self.skillset, self._context.situation, name, value))
        self._after_step(stops)

    # --- interruption and emergency ----------------------------------------------------------------------------------------

    def interrupt(self, execution_id: str) -> bool:
        """Ask for the end of an execution: ``on_interrupt``, then the step. False when it has ended or is not known.

        While ``validate`` runs, it ends at once and never starts; while ``on_dispatch`` runs, the hook follows after it.
        """
        self.tick()
        with self._lock:
            entry = self._context.open(execution_id)
            if entry is None:
                return False
            stop_now = False
            if entry.execution.state is ExecutionState.REQUESTED:
                self._context.end_request(entry, ExecutionState.INTERRUPTED, "interrupted before it started")
            elif not entry.stop_hook:
                entry.stop_hook = "on_interrupt"
                entry.stop_due_ns = self._clock_ns() + round(self._stop_limit_s(entry) * 1e9)
                self._context.enter_phase(entry, ExecutionState.INTERRUPTING)
                stop_now = not entry.dispatching
        self._outbox.deliver()
        if stop_now:
            self._stop(entry)
        return True

    def interrupted(self, execution_id: str, message: str = "") -> bool:
        """Confirm that the stop which ``on_interrupt`` has begun is done; False when none is under way."""
        self.tick()
        return self._interrupted(execution_id, message)

    def _interrupted(self, execution_id: str, message: str) -> bool:
        message = as_text(message)
        with self._lock:
            entry = self._context.active(execution_id)
            if entry is None or entry.execution.state is not ExecutionState.INTERRUPTING:
                return False
            step = semantics.interrupt(self.skillset, self._context.situation, entry.key, message)
            stops = self._context.commit(step, by_itself=entry)
        self._after_step(stops)
        return True

    def _stop(self, entry: Entry) -> None:
        """Call the stop hook; an interruption ends with it unless the hook returns False."""

        def returned(answer: HookOutcome) -> None:
            if answer.value is not False:
                self._interrupted(entry.key.id, "")

        self._call(entry, entry.stop_hook, returned)

    def _stop_limit_s(self, entry: Entry) -> float:
        return self.skillset.skill(entry.key.skill).interrupt.timeout_s or self._interrupt_timeout_s

    def _escalate(self, entry: Entry, limit_s: float) -> None:
        """Call the strongest stop, then give back what the execution holds."""
        self._defer(functools.partial(self._call, entry, "on_emergency"))
        self._interrupted(entry.key.id, f"the stop did not end within {limit_s:g} s; the emergency stop was called")

    # --- pause and resume: a paused execution holds its resources, and its invariants are watched --------------------------

    def set_paused(self, execution_id: str, reply: Reply, *, paused: bool, wait: bool = True) -> None:
        """Pause or resume an execution; ``reply`` is called once, when the hook has answered or there is nothing to ask.

        While the execution is being started, paused or resumed, this waits for its turn; without ``wait`` it is refused then.
        """
        self.tick()
        with self._lock:
            entry = self._context.open(execution_id)
            known = _known_reply(execution_id, entry, paused=paused, wait=wait)
            if entry is not None and known is None:
                if entry.dispatching:
                    entry.waiting.append(lambda: self.set_paused(execution_id, reply, paused=paused))
                    return
                entry.dispatching = True
        if entry is None or known is not None:
            reply(known or PauseReply(accepted=False))
            return
        hook = "on_pause" if paused else "on_resume"
        self._call(entry, hook, lambda answer: self._paused(entry, answer, reply, paused=paused))

    def pause(self, execution_id: str) -> PauseReply:
        """Pause an execution whose hooks are in this process."""
        return self._pause_now(execution_id, paused=True)

    def resume(self, execution_id: str) -> PauseReply:
        """Resume an execution whose hooks are in this process."""
        return self._pause_now(execution_id, paused=False)

    def _pause_now(self, execution_id: str, *, paused: bool) -> PauseReply:
        replies: list[PauseReply] = []
        self.set_paused(execution_id, replies.append, paused=paused, wait=False)
        return replies[0]

    def _paused(self, entry: Entry, answer: HookOutcome, reply: Reply, *, paused: bool) -> None:
        """Enter the phase unless the hook refused or something else has come between."""
        verb, phase = ("paused", ExecutionState.PAUSED) if paused else ("resumed", ExecutionState.RUNNING)
        reason = str(answer.value or "")
        with self._lock:
            state = entry.execution.state
            if state.terminal or state is ExecutionState.INTERRUPTING:
                reason = f"it was {state.value} before it was {verb}"
            elif not reason:
                self._context.enter_phase(entry, phase)
        self._outbox.deliver()
        reply(PauseReply(not reason, reason))

    # --- reports of functions; reports after the end come too late, which is no error -------------------------------------

    def terminate(self, execution_id: str, result: str, message: str = "", outputs: Mapping[str, object] | None = None) -> bool:
        """End a running execution with a result of the model; False when it is not running (any more).

        Outputs that the model does not know, or that do not fit their types, end it as FAILED.
        """
        self.tick()
        result, message = as_text(result), as_text(message)
        values, problem = self._fitted(execution_id, outputs or {})
        with self._lock:
            entry = self._context.active(execution_id)
            if entry is None:
                return False
            situation = self._context.situation
            if problem:
                step = semantics.fail(self.skillset, situation, entry.key, problem)
            else:
                entry.execution.outputs.update(values)
                step = semantics.terminate(self.skillset, situation, entry.key, result, message)
            stops = self._context.commit(step, by_itself=entry)
        self._after_step(stops)
        return True

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED; False when it has ended or is not known."""
        self.tick()
        return self._fail(execution_id, as_text(message))

    def _fail(self, execution_id: str, message: str) -> bool:
        with self._lock:
            entry = self._context.open(execution_id)
            if entry is None:
                return False
            stops: list[Entry] = []
            if entry.execution.state is ExecutionState.REQUESTED:
                self._context.end_request(entry, ExecutionState.FAILED, message)
            else:
                stops = self._context.commit(semantics.fail(self.skillset, self._context.situation, entry.key, message))
        self._after_step(stops)
        return True

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution; those that ``terminate`` would refuse end it as FAILED."""
        values, problem = self._fitted(execution_id, outputs)
        if problem:
            self._fail(execution_id, problem)
            return
        with self._lock:
            entry = self._context.active(execution_id)
            if entry is not None:
                entry.execution.outputs.update(values)

    def _fitted(self, execution_id: str, outputs: Mapping[str, object]) -> tuple[dict[str, object], str]:
        """Return outputs as their types hold them, or what is wrong with them."""
        execution = self.execution(execution_id)
        try:
            return ({} if execution is None else fitted_outputs(self.skillset.skill(execution.skill), outputs)), ""
        except ValueError as error:
            return {}, as_text(error)

    def ask_progress(self, execution_id: str, then: Callable[[float | None], None]) -> None:
        """Ask the ``progress`` hook; ``then`` gets its answer within 0 to 1, or None when the execution is not running.

        Only a RUNNING execution is asked, and not again before its hook has answered; else ``then`` gets the progress that it
        had. An answer that differs from the one before is progress, which puts off the progress deadline. The hook may wait, so
        managers call this on a thread of its own; ``then`` is called there, or where the answer of a hook elsewhere arrives.
        """
        self.tick()
        with self._lock:
            entry = self._context.active(execution_id)
            known = None if entry is None else entry.execution.progress
            asked = entry if entry is not None and entry.may_be_asked else None
            if asked is not None:
                asked.asking = True
        if asked is None:
            then(known)
        else:
            self._call(asked, "progress", lambda answer: then(None if answer.error else self._progressed(execution_id, answer.value)))

    def _progressed(self, execution_id: str, told: object) -> float | None:
        """Keep an execution's progress, as ``call_hook`` has fitted it."""
        with self._lock:
            entry = self._context.active(execution_id)
            if entry is None or not isinstance(told, float):
                return None
            if told != entry.execution.progress and entry.execution.state is ExecutionState.RUNNING:
                self._context.progressed(entry)
            entry.execution.progress = told
        return told

    # --- the end -----------------------------------------------------------------------------------------------------------

    def fail_all(self, message: str) -> None:
        """End all executions as FAILED."""
        for execution in self.executions:
            self.fail(execution.id, message)

    def close(self, message: str) -> None:
        """Fail all executions for ``message``, and refuse all later requests for the same reason."""
        with self._lock:
            self._closed = message
        self.fail_all(message)

    # --- time --------------------------------------------------------------------------------------------------------------

    @property
    def due_ns(self) -> int | None:
        """Return when, on the mission clock, time alone may next change something: then ``tick`` is to be called."""
        with self._lock:
            return self._context.due_ns

    def tick(self) -> None:
        """Take the steps that are due: a duration that has run out, a progress deadline, a stop that is too late.

        Every other step begins with it, so that a late call makes the step late, not another one.
        """
        with self._lock:
            elapsed = self._context.elapsed
            stops = self._context.commit(semantics.elapse(self.skillset, self._context.situation)) if elapsed else []
        if elapsed:
            self._after_step(stops)
        with self._lock:
            now_ns = self._clock_ns()
            late = [entry for entry in self._context.entries.values() if 0 < entry.stop_due_ns <= now_ns and not entry.execution.done]
            for entry in late:
                entry.stop_due_ns = 0
        for entry in late:
            self._escalate(entry, self._stop_limit_s(entry))

    # --- hooks -------------------------------------------------------------------------------------------------------------

    def _call(self, entry: Entry, hook: str, then: Then = _nothing) -> None:
        """Call a hook; one that raises, returns nonsense or does not return ends its execution. ``then`` gets the answer, once."""
        limit_s = self._hook_timeout_s
        if limit_s is not None and hook == "on_interrupt":
            limit_s += self._stop_limit_s(entry)
        watch = None if limit_s is None else WATCHDOG.watch(limit_s, functools.partial(self._overdue, entry, hook, limit_s, then))

        def answered(answer: HookOutcome) -> None:
            problem = f"{hook} raised {answer.error}" if answer.error else answer.wrong
            if problem:
                self._on_error(as_text(f"{entry.execution}: {problem}\n{answer.trace}".strip()))
            if watch is None or watch.end():
                if problem:
                    self._fail(entry.key.id, as_text(problem))
                then(HookOutcome(error=problem) if problem else answer)
            self._returned(entry, hook)

        self._hooks.call(entry.execution, hook, answered)

    def _overdue(self, entry: Entry, hook: str, limit_s: float, then: Then) -> None:
        """End an execution whose hook does not return. The stop hook would wait for it, so ``on_emergency`` stops the function."""
        problem = f"{hook} has not returned within {limit_s:g} s"
        self._on_error(f"{entry.execution}: {problem}")
        if hook == "on_interrupt":
            self._escalate(entry, limit_s)
        else:
            self._fail(entry.key.id, problem)
        if hook in _STARTS | _STOPS:
            self._defer(functools.partial(self._call, entry, "on_emergency"))
        then(HookOutcome(error=problem))
        self._run_waiting(entry)

    def _returned(self, entry: Entry, hook: str) -> None:
        """Run what has waited for a hook that no stop overtakes: the stop, pauses and resumptions.

        Also after an emergency: a late ``on_dispatch`` or ``on_resume`` may have started the function again.
        """
        if hook == "progress":
            entry.asking = False
        if hook not in _STARTS:
            return
        with self._lock:
            entry.dispatching = False
            stop = bool(entry.stop_hook) and entry.execution.state is not ExecutionState.TERMINATED
            self._context.forget_if_through(entry)
        if stop:
            self._stop(entry)
        self._run_waiting(entry)

    def _run_waiting(self, entry: Entry) -> None:
        with self._lock:
            waiting, entry.waiting = entry.waiting, []
        for job in waiting:
            job()

    def _after_step(self, stops: list[Entry]) -> None:
        """Deliver events, then call the stop hooks of executions that the step has ended; called without the lock."""
        self._outbox.deliver()
        for entry in stops:
            self._defer(functools.partial(self._call, entry, entry.stop_hook))

    # --- questions ---------------------------------------------------------------------------------------------------------

    @property
    def resources(self) -> dict[str, ResourceStatus]:
        """Return all resources at one moment."""
        with self._lock:
            return dict(self._context.resources)

    @property
    def executions(self) -> tuple[Execution, ...]:
        """Return those that have not ended."""
        with self._lock:
            return tuple(entry.execution for entry in self._context.entries.values() if not entry.execution.done)

    def execution(self, execution_id: str) -> Execution | None:
        """Return one that has not ended, or None."""
        with self._lock:
            entry = self._context.open(execution_id)
        return None if entry is None else entry.execution

    @property
    def skills(self) -> dict[str, SkillRecord]:
        """Return each skill's open executions and the one that ended last."""
        with self._lock:
            return dict(self._context.records.skills)

    def why(self, skill: str, inputs: object = None) -> Why:
        """Return whether a skill could start now, and if not, why; with inputs ``validate`` is asked, too (hooks in this process).

        Raises:
            KeyError: there is no such skill.
        """
        refusals: list[str] = []
        if inputs is not None:
            self.ask_validate(skill, inputs, refusals.append)
        return self.explain(skill, refusals[0] if refusals else "")

    def ask_validate(self, skill: str, inputs: object, then: Callable[[str], None]) -> None:
        """Ask ``validate`` without an execution; ``then`` gets its refusal or "", or what is wrong with it, once, perhaps later."""
        entry = Entry(Execution(self, "", skill, inputs), Running("", skill))
        self._call(entry, "validate", lambda answer: then(answer.error or str(answer.value)))

    def explain(self, skill: str, refusal: str = "") -> Why:
        """Answer as ``why``, with what ``validate`` has said already."""
        model = self.skillset.skill(skill)
        self.tick()
        with self._lock:
            found = unmet(self.skillset, self._context.situation, model)
            history = self._context.records.history(resources_of(model))
            reason = sentence(found, refusal, self._refusal(skill)) + self._context.cause_of(found)
        return Why(skill, not reason, reason, refusal, found, history)


def _known_reply(execution_id: str, entry: Entry | None, *, paused: bool, wait: bool) -> PauseReply | None:
    """Return the answer to a pause or a resumption where no hook has to be asked for it."""
    if entry is None:
        return PauseReply(accepted=False, reason=f"no execution {execution_id} is open: it has ended, or never was")
    state = entry.execution.state
    if state is (ExecutionState.PAUSED if paused else ExecutionState.RUNNING) and not entry.dispatching:
        return PauseReply(accepted=True)
    if state in {ExecutionState.REQUESTED, ExecutionState.INTERRUPTING}:
        return PauseReply(accepted=False, reason=f"{entry.key.skill} {execution_id} is {state.value}")
    if entry.dispatching and not wait:
        return PauseReply(accepted=False, reason=f"{entry.key.skill} {execution_id} is being started, paused or resumed")
    return None
