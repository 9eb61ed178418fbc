"""The services that are about no single resource or data: ``describe``, ``why`` and ``pause``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from alula.model.json_form import to_json
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.replies import PauseReply
from alula.runtime.core.watchdog import WATCHDOG
from alula.runtime.middleware import ActionServer, Middleware, Reply, WhyReply

HOOK_ANSWERS_S = 10.0
"""A hook that has not answered after so long is said to be silent; in time that this process could run."""


class SkillsetServices:
    """Serves them; a hook that takes its time holds up no other caller."""

    def __init__(
        self,
        middleware: Middleware,
        engine: SkillsetEngine,
        servers: Mapping[str, ActionServer],
        make_inputs: Callable[[str, Mapping[str, object]], object],
    ) -> None:
        self._middleware = middleware
        self._engine = engine
        self._servers = servers
        self._make_inputs = make_inputs
        middleware.serve("describe", lambda _, reply: reply(self._model_json))
        middleware.serve("why", self._why)
        middleware.serve("pause", self._pause)

    @cached_property
    def _model_json(self) -> str:
        return to_json(self._engine.skillset)

    def _why(self, request: Mapping[str, Any], reply: Reply) -> None:
        skill = request["skill"]
        if skill not in self._servers:
            reply(WhyReply(f"skillset {self._engine.skillset.name} has no skill {skill}; it has {', '.join(self._servers)}"))
            return
        if not request["inputs_json"]:
            self._explain(skill, "", reply)
            return
        try:
            inputs = self._inputs(skill, request["inputs_json"])
        except ValueError as error:
            reply(WhyReply(str(error)))
            return
        silent = f"validate has not answered for {HOOK_ANSWERS_S:g} s"
        answer = _in_time(lambda refusal: self._explain(skill, refusal, reply), silent)
        self._middleware.defer(lambda: self._engine.ask_validate(skill, inputs, answer))

    def _explain(self, skill: str, refusal: str, reply: Reply) -> None:
        reply(WhyReply("", self._engine.explain(skill, refusal), self._engine.resources))

    def _pause(self, request: Mapping[str, Any], reply: Reply) -> None:
        silent = PauseReply(accepted=False, reason=f"the hook has not answered for {HOOK_ANSWERS_S:g} s")
        answer = _in_time(reply, silent)
        self._middleware.defer(lambda: self._engine.set_paused(request["id"], answer, paused=request["paused"]))

    def _inputs(self, skill: str, inputs_json: str) -> object:
        """Make what ``validate`` gets; raise ValueError where the JSON does not fit."""
        try:
            values = json.loads(inputs_json)
        except json.JSONDecodeError as error:
            raise ValueError(f"inputs of {skill}: this is no JSON: {error}") from error
        if not isinstance(values, dict):
            raise ValueError(f"inputs of {skill} are a JSON object, not {inputs_json}")  # noqa: TRY004 - of the caller's text, not of a type
        return self._make_inputs(skill, self._servers[skill].inputs_of(values))


def _in_time(reply: Callable[[Any], None], silent: object) -> Callable[[Any], None]:
    """Return what takes a hook's answer, once; a hook that stays silent is answered for."""
    watch = WATCHDOG.watch(HOOK_ANSWERS_S, lambda: reply(silent))

    def answer(value: Any) -> None:
        if watch.end():
            reply(value)

    return answer
