"""The resource manager's end of the link to one skill manager in another process, and the hooks as seen through all of them."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.events import ExecutionEvent
from skill_runtime.core.execution import Execution
from skill_runtime.core.hook_calls import HookAnswer, Then
from skill_runtime.plain import to_plain
from skill_runtime.ros2.link import GONE, LinkEnd


class SkillLink:
    """One skill's manager, wherever it is: calls its hooks, and does with the engine what it asks for."""

    def __init__(self, node: Node, engine: SkillsetEngine, skill: str) -> None:
        self._engine = engine
        self._skill = skill
        self._manager = ""
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._pending: dict[str, Then] = {}
        self._orphans: set[str] = set()
        """Executions that have failed with their manager: nobody has their hooks any more."""
        place = f"{engine.skillset.name}/managers/{skill}"
        self._end = LinkEnd(node, to=f"{place}/calls", of=f"{place}/requests", on_message=self._hear, on_gone=lambda: self._lose(GONE))
        self._handlers: Mapping[str, Callable[[str, dict[str, Any]], None]] = {
            "request": self._request,
            "interrupt": lambda execution, _: self._ignore(engine.interrupt(execution)),
            "progress": lambda execution, body: self._ignore(engine.report_progress(execution, body["value"])),
            "outputs": lambda execution, body: engine.set_outputs(execution, body["outputs"]),
            "terminate": lambda number, body: self._reply(
                number, engine.terminate(body["execution"], body["result"], body["message"], body["outputs"])
            ),
            "fail": lambda number, body: self._reply(number, engine.fail(body["execution"], body["message"])),
            "interrupted": lambda number, body: self._reply(number, engine.interrupted(body["execution"], body["message"])),
            "answer": self._answer,
        }

    @property
    def connected(self) -> bool:
        """Tell whether a manager has said hello and is not lost."""
        return bool(self._manager)

    def call(self, execution: Execution, hook: str, then: Then) -> None:
        """Call a hook over there; who is not there answers with an error."""
        number = str(next(self._numbers))
        with self._lock:
            orphan, manager = execution.id in self._orphans, self._manager
            if manager and not orphan:
                self._pending[number] = then
        if orphan or not manager:
            then(HookAnswer() if orphan else HookAnswer(error=f"the manager of {self._skill} is not there"))
            return
        body = {"hook": hook, "execution": execution.id, "state": execution.state.value}
        body |= {"result": execution.result, "message": execution.message}
        if not execution.id:
            body["inputs"] = to_plain(execution.inputs)
        self._end.send(manager, "call", number, body)

    def tell(self, event: ExecutionEvent) -> None:
        """Pass on an event of an execution of this skill."""
        body = {"state": event.state.value, "result": event.result, "message": event.message, "outputs": to_plain(event.outputs)}
        if self._manager:
            self._end.send(self._manager, "event", event.id, body)

    def _hear(self, message: Any) -> None:
        if message.kind == "hello":
            self._welcome(message.sender)
        elif message.sender != self._manager:
            self._end.send(message.sender, "stranger")
        else:
            self._end.trust()
            handler = self._handlers.get(message.kind)
            if handler is not None:
                handler(message.id, json.loads(message.body_json))

    def _welcome(self, manager: str) -> None:
        if self._manager and self._manager != manager:
            self._lose("its process was started anew")
        with self._lock:
            self._manager = manager
        self._end.trust()
        self._end.send(manager, "welcome")

    def _lose(self, reason: str) -> None:
        """End what the lost manager had: nobody is there any more who could stop, watch or end it."""
        with self._lock:
            if not self._manager:
                return
            self._manager = ""
            pending, self._pending = self._pending, {}
            orphans = [execution.id for execution in self._engine.executions if execution.skill == self._skill]
            self._orphans = set(orphans)
        text = f"the manager of {self._skill} has gone: {reason}"
        for identifier in orphans:
            self._engine.fail(identifier, text)
        for then in pending.values():
            then(HookAnswer(error=text))

    # --- what it asks for --------------------------------------------------------------------------------------------

    def _request(self, execution: str, body: dict[str, Any]) -> None:
        try:
            self._engine.register(self._skill, body["inputs"], execution_id=execution)
        except SkillRuntimeError as error:
            refused = {"state": "FAILED", "result": "", "message": str(error), "outputs": {}}
            self._end.send(self._manager, "event", execution, refused)
            return
        self._engine.run(execution)

    def _answer(self, number: str, body: dict[str, Any]) -> None:
        with self._lock:
            then = self._pending.pop(number, None)
        if then is not None:
            then(HookAnswer(body["value"], body["error"], body["trace"]))

    def _reply(self, number: str, value: object) -> None:
        self._end.send(self._manager, "reply", number, {"value": value})

    @staticmethod
    def _ignore(_: object) -> None:
        """Take an answer that nobody waits for."""


class LinkedHooks:
    """Hooks in other processes, for an engine; ``links`` are filled in when there is an engine to link to."""

    def __init__(self) -> None:
        self.links: dict[str, SkillLink] = {}

    def call(self, execution: Execution, hook: str, then: Then) -> None:
        """Call a hook of the execution's skill."""
        self.links[execution.skill].call(execution, hook, then)

    def written(self, skill: str, hook: str) -> bool:  # noqa: ARG002
        """Tell that it may be: only the other process knows."""
        return True
