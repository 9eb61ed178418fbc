"""What a skill manager has in place of the engine when the resource manager is in another process.

Executions here are images of those over there: every step is taken by the resource manager's engine, which calls the hooks of
this process and tells of each event. Only when it is gone, executions are ended here, and their functions stopped.
"""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import ExecutionEvent
from skill_runtime.core.execution import Execution
from skill_runtime.core.hook_calls import HookAnswer, call_hook
from skill_runtime.hooks import SkillHooks
from skill_runtime.plain import to_plain
from skill_runtime.ros2.resource_link import ResourceLink
from skill_runtime.workers import Job, Workers

STOPS = frozenset({"on_interrupt", "on_violation", "on_failure"})
KEPT = 256
"""Executions that have ended and may still be spoken of: their stop hook is called after the end."""
STARTS = frozenset({"on_dispatch", "on_pause", "on_resume"})
"""Hooks during which ``progress`` is not asked."""


@dataclass(eq=False)
class _Image:
    execution: Execution
    given: dict[str, object] = field(default_factory=dict)
    """Outputs as the hooks gave them; over there they are JSON."""
    busy: int = 0
    stopped: bool = False


class RemoteEngine:
    """The engine as a skill manager sees it (``register``, ``interrupt``, ``progress``...), and the hooks' controller.

    Args:
        skillset: the model.
        skill: the one skill that is managed here.
        hooks: its hooks.
        workers: run the hooks.
        listener: gets each event of an execution of the skill.
        inputs_from: makes the inputs of the skill from their plain values.
        on_error: gets what hooks raise.
    """

    def __init__(
        self,
        skillset: Skillset,
        skill: str,
        hooks: SkillHooks,
        workers: Workers,
        *,
        listener: Callable[[ExecutionEvent], None],
        inputs_from: Callable[[Mapping[str, object]], object],
        on_error: Callable[[str], object],
    ) -> None:
        self.skillset = skillset
        self.link: ResourceLink
        self._skill = skill
        self._hooks = hooks
        self._workers = workers
        self._listener = listener
        self._inputs_from = inputs_from
        self._on_error = on_error
        self._lock = threading.Lock()
        self._images: dict[str, _Image] = {}
        self._ended: OrderedDict[str, _Image] = OrderedDict()

    # --- for the skill manager ---------------------------------------------------------------------------------------

    def register(self, skill: str, inputs: object, *, execution_id: str = "") -> Execution:
        """Ask the resource manager for an execution; the image has FAILED at once when it is not there."""
        image = _Image(Execution(self, execution_id, skill, inputs))
        with self._lock:
            if execution_id in self._images:
                raise SkillRuntimeError(f"skill {skill}: the execution id {execution_id} is in use")
            self._images[execution_id] = image
        if not self.link.send("request", execution_id, {"inputs": to_plain(inputs)}):
            self._end(image, ExecutionState.FAILED, "", f"the resource manager of {self.skillset.name} is not there")
        return image.execution

    def run(self, execution_id: str, submit: Callable[[Job], None]) -> None:
        """Do nothing: a request that was sent is run over there."""

    def interrupt(self, execution_id: str) -> bool:
        """Ask for the end of an execution."""
        return self.link.send("interrupt", execution_id)

    def execution(self, execution_id: str) -> Execution | None:
        """Return one that has not ended, or None."""
        with self._lock:
            image = self._images.get(execution_id)
        return None if image is None else image.execution

    def progress(self, execution_id: str) -> float | None:
        """Ask the ``progress`` hook and tell the resource manager; None when the execution is not running."""
        with self._lock:
            image = self._images.get(execution_id)
        if image is None or not image.execution.state.active:
            return None
        execution = image.execution
        if image.busy or execution.state is not ExecutionState.RUNNING:
            return execution.progress
        answer = call_hook(self._hooks, execution, "progress")
        if answer.error:
            self._on_error(f"{execution}: progress raised\n{answer.trace}")
            self._workers.submit(lambda: self.fail(execution_id, f"progress raised {answer.error}"))
            return None
        self.link.send("progress", execution_id, {"value": to_plain(answer.value)})
        if isinstance(answer.value, int | float):
            execution.progress = min(1.0, max(0.0, float(answer.value)))
        return execution.progress

    def fail_all(self, message: str) -> None:
        """End whatever was asked for or runs here as FAILED."""
        with self._lock:
            open_now = list(self._images)
        for execution_id in open_now:
            self.fail(execution_id, message)

    # --- for the hooks (Controller) ----------------------------------------------------------------------------------

    def terminate(self, execution_id: str, result: str, message: str, outputs: Mapping[str, object]) -> bool:
        """End a running execution with a result of the model."""
        self._keep(execution_id, outputs)
        body = {"execution": execution_id, "result": result, "message": message, "outputs": to_plain(dict(outputs))}
        return self.link.ask("terminate", body)

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED."""
        return self.link.ask("fail", {"execution": execution_id, "message": message})

    def interrupted(self, execution_id: str, message: str) -> bool:
        """Say that a stop is done."""
        return self.link.ask("interrupted", {"execution": execution_id, "message": message})

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution."""
        image = self._keep(execution_id, outputs)
        if image is not None:
            image.execution.outputs.update(outputs)
        self.link.send("outputs", execution_id, {"outputs": to_plain(dict(outputs))})

    # --- for the link ------------------------------------------------------------------------------------------------

    def on_call(self, number: str, body: dict[str, Any]) -> None:
        """Call a hook on a worker and send what came of it."""
        with self._lock:
            image = self._images.get(body["execution"]) or self._ended.get(body["execution"])
            if image is not None:
                _follow(image.execution, body)
                image.busy += body["hook"] in STARTS
                image.stopped |= body["hook"] in STOPS
        self._workers.submit(functools.partial(self._call, number, body, image))

    def on_told(self, execution_id: str, body: dict[str, Any]) -> None:
        """Follow an event of an execution."""
        with self._lock:
            image = self._images.get(execution_id)
        state = ExecutionState(body["state"])
        if image is None or state is ExecutionState.REQUESTED:
            return
        image.execution.outputs = {name: image.given.get(name, value) for name, value in body["outputs"].items()}
        if state.terminal:
            self._end(image, state, body["result"], body["message"])
            return
        with self._lock:
            _follow(image.execution, body)
        self._listener(_event(image.execution, state))

    def on_gone(self, reason: str) -> None:
        """End everything here, and stop what runs: nobody else would."""
        with self._lock:
            images = list(self._images.values())
        for image in images:
            started = image.execution.state.active
            self._end(image, ExecutionState.FAILED, "", reason)
            if started and not image.stopped:
                self._workers.submit(functools.partial(self._stop, image))

    # --- parts -------------------------------------------------------------------------------------------------------

    def _call(self, number: str, body: dict[str, Any], image: _Image | None) -> None:
        execution = image.execution if image is not None else Execution(self, "", self._skill, None)
        if "inputs" in body:
            answer = self._validated(body["inputs"])
        elif image is None:
            answer = HookAnswer(error=f"{body['hook']}: there is no execution {body['execution']} here")
        else:
            answer = call_hook(self._hooks, execution, body["hook"])
            with self._lock:
                image.busy -= body["hook"] in STARTS
        self.link.send("answer", number, {"value": to_plain(answer.value), "error": answer.error, "trace": answer.trace})

    def _validated(self, values: Mapping[str, object]) -> HookAnswer:
        """Ask ``validate`` without an execution."""
        try:
            return call_hook(self._hooks, Execution(self, "", self._skill, self._inputs_from(values)), "validate")
        except Exception as error:  # noqa: BLE001 - inputs are made by the developer's class
            return HookAnswer(error=f"{type(error).__name__}: {error}")

    def _stop(self, image: _Image) -> None:
        answer = call_hook(self._hooks, image.execution, "on_failure")
        if answer.error:
            self._on_error(f"{image.execution}: on_failure raised\n{answer.trace}")

    def _keep(self, execution_id: str, outputs: Mapping[str, object]) -> _Image | None:
        with self._lock:
            image = self._images.get(execution_id)
            if image is not None:
                image.given.update(outputs)
        return image

    def _end(self, image: _Image, state: ExecutionState, result: str, message: str) -> None:
        """Enter a terminal state, once."""
        execution = image.execution
        with self._lock:
            if self._images.pop(execution.id, None) is None:
                return
            self._ended[execution.id] = image
            if len(self._ended) > KEPT:
                self._ended.popitem(last=False)
            execution.result, execution.message = result, message
            execution.state = state
        self._listener(_event(execution, state))


def _follow(execution: Execution, body: Mapping[str, Any]) -> None:
    """Take over state, result and message as they are over there."""
    if not execution.state.terminal:
        execution.result, execution.message = body["result"], body["message"]
        execution.state = ExecutionState(body["state"])


def _event(execution: Execution, state: ExecutionState) -> ExecutionEvent:
    return ExecutionEvent(
        sequence=0,
        stamp_ns=0,
        skill=execution.skill,
        id=execution.id,
        state=state,
        result=execution.result,
        message=execution.message,
        inputs=execution.inputs,
        outputs=dict(execution.outputs),
    )
