"""What skills have in common whose function is another node's server: an action's or a service's."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.execution import Execution
from alula.runtime.core.sanitize import error_line
from alula.runtime.hooks import SkillHooks
from skillset_ros2.convert import fields_of, fill
from skillset_ros2.watch import Watch

_TERMINATED = "terminated_"
FOUND_S = 1.0
"""Wall clock; so long a server that runs may take to be found when the managers start."""
AGAIN_S = 1.0
"""How often a service is asked to stop what ran before until it answers: DDS loses answers to clients that it has just discovered."""


@dataclass(frozen=True)
class Ending:
    """How an execution ends: a result of the model, a message for people, outputs by name."""

    result: str
    message: str = ""
    outputs: Mapping[str, object] = field(default_factory=dict)


@dataclass(eq=False)
class Call:
    """What was asked of a server for one execution; ``since_s``: when it was last heard of, mission clock."""

    execution: Execution
    server: str
    since_s: float
    stopping: bool = False
    """Whether an interruption waits for its end."""


@dataclass(eq=False)
class LateStop:
    """What stops what ran before, at a server that was not there when the managers started: it, or a bridge to it, may come later."""

    client: Any
    request: Any
    asked_s: float = -math.inf
    """When it was asked last, mission clock."""


CallT = TypeVar("CallT", bound=Call)


class FunctionSkill(SkillHooks, Generic[CallT]):
    """Base of ``ActionSkill`` and ``ServiceSkill``: one call of a server for each execution, several at a time where the model allows.

    A class names these; ``results`` and ``lost`` are results of the model, which is checked when the hooks are made.
    """

    server: ClassVar[str] = ""
    """The server's name, without a slash in front: a run may have a namespace."""
    answer_s: ClassVar[float] = 5.0
    """How long the server may take to be there, and then to answer, mission clock."""
    results: ClassVar[Mapping[Any, str]] = {}
    """The result of each answer."""
    lost: ClassVar[str] = ""
    """The result where the server is absent, refuses, falls silent or answers what is not in ``results``; "": the execution is FAILED."""

    def __init__(self, watch: Watch) -> None:
        super().__init__()
        self.watch = watch
        self._lock = threading.RLock()
        self._calls: dict[str, CallT] = {}
        self._late: LateStop | None = None
        _check_results(type(self))
        watch.every(self._look, lambda: bool(self._calls) or self._late is not None)

    def call_at_start(self, kind: Any, server: str, request: Any) -> None:
        """Call a service that stops what runs until it answers, wall clock; one that is not there is called when it comes.

        Raises:
            SkillRuntimeError: it does not answer.
        """
        client = self.watch.node.create_client(kind, server)
        if not client.wait_for_service(timeout_sec=FOUND_S):
            self._late = LateStop(client, request)
            self.watch.wake()
            return
        try:
            answered, end_s = threading.Event(), time.monotonic() + self.answer_s
            while (left_s := end_s - time.monotonic()) > 0.0:
                client.call_async(request).add_done_callback(lambda _: answered.set())
                if answered.wait(min(AGAIN_S, left_s)):
                    return
            raise SkillRuntimeError(f"{server} does not answer for {self.answer_s:g} s")
        finally:
            self.watch.node.destroy_client(client)

    @property
    def stops_first(self) -> bool:
        """Return whether a server that has just come is being told to stop what runs: nothing is asked of it before it has answered."""
        with self._lock:  # another thread may be about to destroy the client
            late = self._late
            return late is not None and late.client.wait_for_service(timeout_sec=0.0)

    def forget_late_stop(self) -> None:
        """Call no service any more that stops what ran before: something else runs now."""
        with self._lock:
            late, self._late = self._late, None
            if late is not None:
                self.watch.node.destroy_client(late.client)

    def server_for(self, inputs: Any) -> str:  # noqa: ARG002
        """Return the server for these inputs."""
        return self.server

    def begin(self, call: CallT) -> None:
        """Wait for a server's answer from now on; called with the lock held."""
        self._calls[call.execution.id] = call
        self.watch.wake()
        self.look(call)

    def look(self, call: CallT) -> str:
        """Ask the server once it is there; return why it is lost, or "". Called several times a second with the lock held."""
        raise NotImplementedError

    def give_up(self, call: CallT, why: str) -> None:
        """Leave a server that is lost."""
        self.lose(call, f"{call.server} {why}")

    def waited_s(self, call: CallT) -> float:
        """Return how long ago the server was last received from, seconds of mission clock."""
        return self.watch.now_s - call.since_s

    def is_open(self, call: CallT) -> bool:
        """Return whether this is still what the execution waits for: it has neither ended nor asked anew."""
        return self._calls.get(call.execution.id) is call

    def forget(self, execution: Execution) -> CallT | None:
        """Wait for nothing any more; return what was waited for."""
        with self._lock:
            return self._calls.pop(execution.id, None)

    def end(self, call: CallT, ending: Callable[[], Ending]) -> None:
        """End the execution, once; as INTERRUPTED where that was asked for, as FAILED where ``ending`` raises."""
        with self._lock:
            if not self.is_open(call):
                return
            self._calls.pop(call.execution.id)
        if call.stopping:
            call.execution.interrupted()
            return
        try:
            said = ending()
        except Exception as error:  # noqa: BLE001 - this runs on the executor of the node, which lives on
            call.execution.fail(error_line(error))
            return
        call.execution.terminate(said.result, said.message, said.outputs)

    def lose(self, call: CallT, message: str) -> None:
        """End the execution with the result for a server that is lost."""
        with self._lock:
            if not self.is_open(call):
                return
            self._calls.pop(call.execution.id)
        if call.stopping:
            call.execution.interrupted(message)
        elif self.lost:
            call.execution.terminate(self.lost, message)
        else:
            call.execution.fail(message)

    def _stop_late(self) -> None:
        """Call what stops what ran before, as soon as its server is there, until it answers."""
        with self._lock:
            late = self._late
            if late is None:
                return
            if not self.stops_first:
                late.asked_s = -math.inf  # it is not there yet, or has gone again without an answer
            elif self.watch.now_s - late.asked_s >= AGAIN_S:
                late.asked_s = self.watch.now_s
                late.client.call_async(late.request).add_done_callback(lambda _: self.forget_late_stop())

    def _look(self) -> None:
        self._stop_late()
        for call in list(self._calls.values()):
            with self._lock:
                why = self.look(call) if self.is_open(call) else ""
            if why:
                self.give_up(call, why)


def filled(message: Any, inputs: object, place: str) -> Any:
    """Return a message with the inputs in its fields of the same names; the others keep their defaults."""
    fields, values = fields_of(message), vars(inputs)
    return fill(message, {name: values[name] for name in values if name in fields}, place)


def said_by(answer: object) -> str:
    """Return the reason in an answer: its field ``message``."""
    return str(getattr(answer, "message", ""))


def _check_results(kind: type[FunctionSkill[Any]]) -> None:
    """Raise SkillRuntimeError where the class names results that its skill has not, as the generated base tells."""
    known = [name.removeprefix(_TERMINATED) for name in dir(kind) if name.startswith(_TERMINATED)]
    named = [*kind.results.values(), *([kind.lost] if kind.lost else [])]
    unknown = [name for name in named if name not in known]
    if known and unknown:
        raise SkillRuntimeError(f"{kind.__name__}: its skill has no result {unknown[0]}; the model has {', '.join(known)}")
