"""A skill's end: has the hooks, and calls them as the engine asks."""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.runtime.core.execution import Execution
from alula.runtime.core.hook_calls import HookOutcome, call_hook
from alula.runtime.core.sanitize import as_text, error_line
from alula.runtime.hook_processes.pipe import Snapshot, hang_up, opened, pipe_key, sealed
from alula.runtime.hooks import HOOKS, SkillHooks, is_written
from alula.runtime.workers import Workers

AGAIN_S = 0.1
"""How often an engine that is not there is looked for, wall clock."""
REPLY_S = 10.0
"""How long a hook waits for the engine's reply, wall clock; no reply by then counts as a refusal."""
ENDED_KEPT = 100
STOPS = frozenset({"on_violation", "on_failure"})


class HookServer:
    """Serves the hooks of one skill, on threads of their own, to whatever engine of this user is at an address; ``close`` ends it.

    Raises:
        SkillRuntimeError: the key of this user's processes can't be had.
    """

    def __init__(self, skillset: str, skill: str, hooks: SkillHooks, address: str, on_error: Callable[[str], object]) -> None:
        self._skillset = skillset
        self._skill = skill
        self._hooks = hooks
        self._address = address
        self._key = pipe_key(address)
        self._on_error = on_error
        self._workers = Workers(f"{skillset}_{skill}_hooks", on_error)
        self._executions: dict[str, Execution] = {}
        self._ended: deque[str] = deque(maxlen=ENDED_KEPT)
        self._pipe: Connection | None = None
        self._sending = threading.Lock()
        self._numbers = itertools.count(1)
        self._replies: dict[int, tuple[threading.Event, list[object]]] = {}
        self._stopped: dict[str, threading.Event] = {}
        """Executions whose function was stopped, or that are waited for."""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"{skill}_pipe", daemon=True)
        self._thread.start()

    def close(self, reason: str, timeout_s: float) -> bool:
        """Stop what runs, for this reason; tell whether all hooks have returned within the time."""
        end_s = time.monotonic() + timeout_s
        running = [one for one in self._executions.values() if one.state in {ExecutionState.RUNNING, ExecutionState.PAUSED}]
        failed = [execution for execution in running if self.fail(execution.id, reason)]
        self.fail_all(reason)
        # The engine has their functions stopped over this pipe: it has to stay open for that.
        for execution in failed:
            self._stopped.setdefault(execution.id, threading.Event()).wait(max(0.0, end_s - time.monotonic()))
        returned = self._workers.close(max(0.0, end_s - time.monotonic()))
        self._over.set()
        pipe = self._pipe
        if pipe is not None:
            hang_up(pipe)
        return returned

    def fail_all(self, reason: str) -> None:
        """Fail what runs, so that it is stopped."""
        for execution in list(self._executions.values()):
            if not execution.done:
                self.fail(execution.id, reason)

    # --- for executions (see Controller); from the hooks' threads -----------------------------------------------------

    def terminate(self, execution_id: str, result: str, message: str, outputs: Mapping[str, object]) -> bool:
        """End a running execution with a result of the model."""
        return self._ask("terminate", execution_id, as_text(result), as_text(message), dict(outputs))

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED."""
        return self._ask("fail", execution_id, as_text(message))

    def interrupted(self, execution_id: str, message: str) -> bool:
        """End an execution that is being interrupted."""
        return self._ask("interrupted", execution_id, as_text(message))

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution."""
        self._ask("set_outputs", execution_id, dict(outputs))

    def _ask(self, method: str, execution_id: str, *arguments: object) -> bool:
        number = next(self._numbers)
        arrived, value = self._replies.setdefault(number, (threading.Event(), []))
        try:
            self._send(("ask", number, method, execution_id, sealed(arguments)))
        except Exception as error:  # noqa: BLE001 - of pickle, for whatever a hook hands over
            return self._ask("fail", execution_id, f"the outcome of {self._skill}'s hook can't be sent: {error_line(error)}")
        arrived.wait(REPLY_S if self._pipe is not None else 0.0)
        self._replies.pop(number, None)
        return bool(value and value[0])

    # --- the pipe ----------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        """Find the engine, serve it to its end, and find the next one."""
        strange = False
        while not self._over.is_set():
            try:
                pipe = Client(self._address, authkey=self._key)
            except (OSError, EOFError):
                self._over.wait(AGAIN_S)
                continue
            except (AuthenticationError, AssertionError):
                if not strange:
                    self._on_error(f"the process that listens at {self._address} does not have this user's key; end it")
                strange = True
                self._over.wait(AGAIN_S)
                continue
            strange = False
            written = [hook for hook in HOOKS if is_written(self._hooks, hook)]
            self._pipe = pipe
            if self._over.is_set():
                return  # `close` may have come before there was a pipe to end
            self._send(("hello", self._skill, written))
            self._read(pipe)
            self._pipe = None
            if not self._over.is_set():
                self._engine_gone()

    def _read(self, pipe: Connection) -> None:
        while True:
            try:
                kind, *rest = pipe.recv()
            except (EOFError, OSError):
                return
            except Exception as error:  # noqa: BLE001 - unpickling raises anything
                self._on_error(f"what the engine of {self._skillset} sent can't be read: {error_line(error)}")
                hang_up(pipe)
                return
            if kind == "call":
                self._call(*rest)
            elif kind == "event":
                self._follow(rest[0])
            elif kind == "reply" and rest[0] in self._replies:
                arrived, value = self._replies[rest[0]]
                value.append(rest[1])
                arrived.set()

    def _call(self, number: int, hook: str, content: bytes) -> None:
        try:
            execution = self._update(opened(content))
        except Exception as error:  # noqa: BLE001 - unpickling raises anything
            self._send(("answer", number, sealed(HookOutcome(error=f"its inputs can't be read: {error_line(error)}"))))
            return
        self._workers.submit(lambda: self._send(("answer", number, self._sealed(self._answer(execution, hook)))))

    @staticmethod
    def _sealed(answer: HookOutcome) -> bytes:
        try:
            return sealed(answer)
        except Exception as error:  # noqa: BLE001 - of pickle, for whatever a hook returns
            return sealed(HookOutcome(wrong=f"what its hook returned can't be sent: {error_line(error)}"))

    def _answer(self, execution: Execution, hook: str) -> HookOutcome:
        if isinstance(execution.inputs, Mapping):
            try:
                execution.inputs = self._hooks.make_inputs(execution.inputs)
            except Exception as error:  # noqa: BLE001 - inputs are made by the developer's class
                return HookOutcome(error=f"the inputs could not be made: {type(error).__name__}: {error}")
        answer = call_hook(self._hooks, execution, hook)
        if hook in STOPS and execution.done:
            self._stopped.setdefault(execution.id, threading.Event()).set()
        return answer

    def _update(self, snapshot: Snapshot) -> Execution:
        execution = self._executions.get(snapshot.id)
        if execution is None:
            execution = Execution(self, snapshot.id, self._skill, snapshot.inputs)
            if snapshot.id:
                self._executions[snapshot.id] = execution
        self._take(execution, snapshot)
        return execution

    def _follow(self, snapshot: Snapshot) -> None:
        execution = self._executions.get(snapshot.id)
        if execution is not None:
            self._take(execution, snapshot)
            if snapshot.state.terminal:
                self._forget_later(snapshot.id)

    def _forget_later(self, execution_id: str) -> None:
        """Keep an execution that has ended for the hook that stops its function."""
        if len(self._ended) == ENDED_KEPT:
            self._executions.pop(self._ended[0], None)
            self._stopped.pop(self._ended[0], None)
        self._ended.append(execution_id)

    @staticmethod
    def _take(execution: Execution, snapshot: Snapshot) -> None:
        execution.state, execution.result, execution.message = snapshot.state, snapshot.result, snapshot.message
        execution.outputs, execution.progress = dict(snapshot.outputs), snapshot.progress or execution.progress

    def _engine_gone(self) -> None:
        """End everything: the engine knows nothing of it any more."""
        for arrived, _ in list(self._replies.values()):
            arrived.set()
        executions, self._executions = list(self._executions.values()), {}
        for execution in executions:
            if execution.done:
                continue
            execution.state = ExecutionState.FAILED
            execution.message = f"the resource manager of {self._skillset} has gone: its process has ended"
            self._workers.submit(lambda execution=execution: self._stop(execution))  # type: ignore[misc]

    def _stop(self, execution: Execution) -> None:
        answer = call_hook(self._hooks, execution, "on_failure")
        if answer.error:
            self._on_error(f"{execution}: on_failure raised\n{answer.trace}")
        self._stopped.setdefault(execution.id, threading.Event()).set()

    def _send(self, message: Any) -> None:
        pipe = self._pipe
        if pipe is None:
            return
        with self._sending, contextlib.suppress(OSError):
            pipe.send(message)
