"""The services that answer questions and take wishes in ROS 1: ``describe``, ``why`` and ``pause``; each call has its own thread."""

from __future__ import annotations

import json
import queue
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import rospy
from skillset_interfaces.srv import Describe, DescribeResponse, SetPaused, SetPausedResponse, WhyResponse
from skillset_interfaces.srv import Why as WhyService

from skill_model.json_form import to_json
from skill_runtime.core.engine import PauseReply, SkillsetEngine
from skill_runtime.hooks import SkillHooks
from skill_runtime.messages import fill_why
from skill_runtime.workers import Workers
from skillset_ros1.convert import fill, values_of
from skillset_ros1.names import ActionTypes

HOOK_ANSWERS_S = 10.0
"""A hook that has not answered after so long (wall clock) is said to be silent."""
T = TypeVar("T")


class Answers:
    """Serves the questions; a hook that takes its time holds up nobody else."""

    def __init__(
        self, place: str, engine: SkillsetEngine, workers: Workers, types: Mapping[str, ActionTypes], hooks: Mapping[str, SkillHooks]
    ) -> None:
        self._engine = engine
        self._workers = workers
        self._types = types
        self._hooks = hooks
        self._model_json = to_json(engine.skillset)
        self._services = [
            rospy.Service(f"{place}/describe", Describe, lambda _: DescribeResponse(model_json=self._model_json)),
            rospy.Service(f"{place}/why", WhyService, self._why),
            rospy.Service(f"{place}/pause", SetPaused, self._pause),
        ]

    def close(self) -> None:
        """Take the services away."""
        for service in self._services:
            service.shutdown()

    def _why(self, request: Any) -> Any:
        if request.skill not in self._types:
            known = ", ".join(self._types)
            return WhyResponse(reason=f"skillset {self._engine.skillset.name} has no skill {request.skill}; it has {known}")
        refusal = ""
        if request.inputs_json:
            try:
                inputs = self._inputs(request.skill, request.inputs_json)
            except ValueError as error:
                return WhyResponse(reason=str(error))
            silent = f"validate has not answered for {HOOK_ANSWERS_S:g} s"
            refusal = self._asked(lambda then: self._engine.ask_validate(request.skill, inputs, then), silent)
        return fill_why(WhyResponse(), self._engine.explain(request.skill, refusal), self._engine.resources)

    def _pause(self, request: Any) -> Any:
        silent = PauseReply(accepted=False, reason=f"the hook has not answered for {HOOK_ANSWERS_S:g} s")
        reply = self._asked(lambda then: self._engine.set_paused(request.id, then, paused=request.paused), silent)
        return SetPausedResponse(accepted=reply.accepted, reason=reply.reason)

    def _asked(self, ask: Callable[[Callable[[T], None]], object], otherwise: T) -> T:
        """Return what a hook answers, or ``otherwise`` after a time: a hook that hangs must not hang who asks."""
        answer: queue.SimpleQueue[T] = queue.SimpleQueue()
        self._workers.submit(lambda: ask(answer.put))
        try:
            return answer.get(timeout=HOOK_ANSWERS_S)
        except queue.Empty:
            return otherwise

    def _inputs(self, skill: str, inputs_json: str) -> object:
        """Make what ``validate`` gets; raise ValueError where the JSON does not fit."""
        place = f"inputs of {skill}"
        try:
            values = json.loads(inputs_json)
        except json.JSONDecodeError as error:
            raise ValueError(f"{place}: this is no JSON: {error}") from error
        if not isinstance(values, dict):
            raise ValueError(f"{place} are a JSON object, not {inputs_json}")  # noqa: TRY004 - of the caller's text, not of a type
        return self._hooks[skill].make_inputs(values_of(fill(self._types[skill].goal(), values, place)))
