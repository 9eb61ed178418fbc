"""The engine's end: calls hooks that are in other processes."""

from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Sequence
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path

from alula.model.model import Skillset
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.core.hook_calls import HookOutcome, Then
from alula.runtime.core.sanitize import error_line
from alula.runtime.hook_processes.pipe import Snapshot, admit, hang_up, opened, pipe_key, sealed, snapshot

ENDED = "its process has ended"
ASKED = {"terminate", "fail", "interrupted", "set_outputs"}
"""What a skill's process may ask of the engine."""


class RemoteHooks:
    """Calls the hooks of a skillset over the pipe at an address; ``attach`` the engine before anything is asked of it.

    Raises:
        SkillRuntimeError: another process serves this address, or the key of this user's processes can't be had.
    """

    def __init__(self, skillset: Skillset, address: str, on_error: Callable[[str], None]) -> None:
        self._on_error = on_error
        self._engine: SkillsetEngine | None = None
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._processes: dict[str, _SkillProcess] = {}
        self._skills = [skill.name for skill in skillset.skills]
        self._over = False
        self._key = pipe_key(address)
        _take_over(address)
        self._listener = Listener(address, backlog=len(self._skills) + 1)
        threading.Thread(target=self._accept, name="hook_processes", daemon=True).start()

    def attach(self, engine: SkillsetEngine) -> None:
        """Take the engine whose hooks these are."""
        self._engine = engine

    def wait(self, timeout_s: float) -> list[str]:
        """Wait (wall clock) until all skills' processes are there; return the skills of those that are not."""
        with self._changed:
            self._changed.wait_for(lambda: self._over or len(self._processes) == len(self._skills), timeout_s)
            return [skill for skill in self._skills if skill not in self._processes]

    def close(self) -> None:
        """Close all pipes and the listener; each process ends when its pipe closes."""
        with self._changed:
            self._over = True
            processes = list(self._processes.values())
            self._changed.notify_all()
        with contextlib.suppress(OSError):
            self._listener.close()
        for process in processes:
            process.close()

    # --- for the engine ----------------------------------------------------------------------------------------------

    def call(self, execution: Execution, hook: str, then: Then) -> None:
        """Call a hook; ``then`` gets the answer later, on the thread of its process, or at once when that has gone."""
        process = self._processes.get(execution.skill)
        if process is None:
            then(HookOutcome(error=f"the manager of {execution.skill} has gone: {ENDED}"))
        else:
            process.call(hook, snapshot(execution), then)

    def written(self, skill: str, hook: str) -> bool:
        """Return whether the hook is written; of a process that has gone, it is taken for written, so that the call says so."""
        process = self._processes.get(skill)
        return process is None or hook in process.written

    def on_step(self, events: Sequence[EngineEvent]) -> None:
        """Send each skill's process the events of its executions."""
        for event in events:
            process = self._processes.get(event.skill) if isinstance(event, ExecutionEvent) else None
            if process is not None and isinstance(event, ExecutionEvent):
                process.report(Snapshot(event.id, None, event.state, event.result, event.message, dict(event.outputs), 0.0))

    # --- inside ------------------------------------------------------------------------------------------------------

    def _accept(self) -> None:
        while not self._over:
            try:
                pipe = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(pipe,), name="hook_process", daemon=True).start()

    def _serve(self, pipe: Connection) -> None:
        """Serve one skill's process to its end, once it has shown that it is of this user."""
        try:
            # Here, not where connections are accepted: one that says nothing would keep out all others.
            admit(pipe, self._key)
            _, skill, written = pipe.recv()
        except (AuthenticationError, AssertionError):
            self._on_error("a process without this user's key was refused at the pipe of the hooks")
            pipe.close()
            return
        except (EOFError, OSError):
            pipe.close()
            return
        except Exception as error:  # noqa: BLE001 - unpickling raises anything
            self._on_error(f"what a process said at the pipe of the hooks can't be read: {error_line(error)}")
            pipe.close()
            return
        process = _SkillProcess(pipe, frozenset(written), self._ask)
        if self._engine is None:
            self._take(skill, process)
        else:
            self._restart(self._engine, skill, process)
        why = process.read()
        with self._changed:
            if self._processes.get(skill) is process:
                del self._processes[skill]
        self._lost(skill, process, why)

    def _restart(self, engine: SkillsetEngine, skill: str, process: _SkillProcess) -> None:
        """Take another process of a skill, which stops first what the one before has left running."""

        def take(call: Callable[[], None]) -> None:
            self._take(skill, process)
            call()

        engine.start([skill], take, lambda: None)

    def _take(self, skill: str, process: _SkillProcess) -> None:
        with self._changed:
            before = self._processes.get(skill)
            self._processes[skill] = process
            self._changed.notify_all()
        if before is not None:
            before.close()

    def _lost(self, skill: str, process: _SkillProcess, why: str) -> None:
        gone = f"the manager of {skill} has gone: {why}"
        if self._engine is not None and not self._over:
            for execution in self._engine.executions:
                if execution.skill == skill:
                    self._engine.fail(execution.id, gone)
        process.give_up(HookOutcome(error=gone))

    def _ask(self, method: str, arguments: tuple[object, ...]) -> object:
        if self._engine is None or method not in ASKED:
            return False
        return getattr(self._engine, method)(*arguments)


class _SkillProcess:
    """The pipe to one skill's process."""

    def __init__(self, pipe: Connection, written: frozenset[str], ask: Callable[[str, tuple[object, ...]], object]) -> None:
        self.written = written
        self._pipe = pipe
        self._ask = ask
        self._sending = threading.Lock()
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._waiting: dict[int, Then] = {}
        self._gone: HookOutcome | None = None
        """What calls are answered once the process has ended."""

    def call(self, hook: str, execution: Snapshot, then: Then) -> None:
        """Send a call; ``then`` gets the outcome, at once where the process has gone."""
        number = next(self._numbers)
        with self._lock:
            gone = self._gone
            if gone is None:
                self._waiting[number] = then
        if gone is None:
            try:
                self._send(("call", number, hook, sealed(execution)))
            except Exception as error:  # noqa: BLE001 - of pickle, for whatever a caller hands over
                with self._lock:
                    unanswered = self._waiting.pop(number, None) is not None
                gone = HookOutcome(error=f"its inputs can't be sent: {error_line(error)}") if unanswered else None
        if gone is not None:
            then(gone)

    def report(self, execution: Snapshot) -> None:
        """Send what has become of an execution."""
        self._send(("event", execution))

    def read(self) -> str:
        """Take what comes until the process ends, or sends what can't be read; return why."""
        while True:
            try:
                kind, number, *rest = self._pipe.recv()
            except (EOFError, OSError):
                return ENDED
            except Exception as error:  # noqa: BLE001 - unpickling raises anything
                return self._refuse(error)
            try:
                if kind == "answer":
                    self._answered(number, *rest)
                else:
                    self._send(("reply", number, self._asked(*rest)))
            except Exception as error:  # noqa: BLE001 - it is not made as messages are
                return self._refuse(error)

    def _refuse(self, error: Exception) -> str:
        self.close()  # upon which the process gives up its executions, too, and makes another pipe
        return f"what it sent can't be read: {error_line(error)}"

    def _answered(self, number: int, content: bytes) -> None:
        then = self._waiting.pop(number, None)
        if then is None:
            return
        try:
            answer = opened(content)
        except Exception as error:  # noqa: BLE001 - unpickling raises anything
            answer = HookOutcome(wrong=f"what its hook returned can't be read: {error_line(error)}")
        then(answer)

    def _asked(self, method: str, execution_id: str, content: bytes) -> object:
        try:
            arguments = opened(content)
        except Exception as error:  # noqa: BLE001 - unpickling raises anything
            self._ask("fail", (execution_id, f"what its hook handed over can't be read: {error_line(error)}"))
            return False
        return self._ask(method, (execution_id, *arguments))

    def give_up(self, answer: HookOutcome) -> None:
        """Answer all calls for a process that has ended, also those that are still on their way here."""
        with self._lock:
            self._gone = answer
            waiting, self._waiting = self._waiting, {}
        for then in waiting.values():
            then(answer)

    def close(self) -> None:
        """End the pipe, upon which the process ends."""
        hang_up(self._pipe)

    def _send(self, message: object) -> None:
        with self._sending, contextlib.suppress(OSError):
            self._pipe.send(message)


def _take_over(address: str) -> None:
    """Remove the socket of a process that has ended; raise SkillRuntimeError when it lives."""
    try:
        Client(address).close()
    except FileNotFoundError:
        return
    except OSError:
        Path(address).unlink(missing_ok=True)
        return
    raise SkillRuntimeError(f"another process already manages this skillset ({address}); end it first")
