"""The services that answer questions and take wishes: ``why`` and ``pause``."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from skillset_interfaces.msg import DataValue, ResourceState, ResourceTransition, Unmet
from skillset_interfaces.srv import SetPaused
from skillset_interfaces.srv import Why as WhyService

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.pauses import PauseReply
from skill_runtime.core.why import Why
from skill_runtime.plain import to_plain
from skill_runtime.ros2.deferred import Answer
from skill_runtime.ros2.workers import Workers

HOOK_ANSWERS_S = 10.0
"""A hook that has not answered after so long (wall clock) is said to be silent."""

MakeInputs = Callable[[str, str], object]
"""Makes the inputs of a skill from their JSON; raises ValueError where they don't fit."""


class Answers:
    """Serves ``why`` and ``pause``; a hook that takes its time holds up nobody else."""

    def __init__(self, node: Node, engine: SkillsetEngine, workers: Workers, make_inputs: MakeInputs) -> None:
        self._workers = workers
        self._engine = engine
        self._make_inputs = make_inputs
        name = engine.skillset.name
        node.create_service(WhyService, f"{name}/why", self._why)
        node.create_service(SetPaused, f"{name}/pause", self._pause)

    async def _why(self, request: Any, response: Any) -> Any:
        names = [skill.name for skill in self._engine.skillset.skills]
        if request.skill not in names:
            response.reason = f"skillset {self._engine.skillset.name} has no skill {request.skill}; it has {', '.join(names)}"
            return response
        refusal = ""
        if request.inputs_json:
            try:
                inputs = self._make_inputs(request.skill, request.inputs_json)
            except ValueError as error:
                response.reason = str(error)
                return response
            refusal = await self._validated(request.skill, inputs)
        return why_message(response, self._engine.explain(request.skill, refusal), self._engine.resources)

    async def _validated(self, skill: str, inputs: object) -> str:
        answer: Answer[str] = Answer()
        self._workers.submit(lambda: self._engine.ask_validate(skill, inputs, answer.give))
        return await answer.within(HOOK_ANSWERS_S, f"validate has not answered for {HOOK_ANSWERS_S:g} s")

    async def _pause(self, request: Any, response: Any) -> Any:
        answer: Answer[PauseReply] = Answer()
        self._workers.submit(lambda: self._engine.set_paused(request.id, answer.give, paused=request.paused))
        silent = PauseReply(accepted=False, reason=f"the hook has not answered for {HOOK_ANSWERS_S:g} s")
        reply = await answer.within(HOOK_ANSWERS_S, silent)
        response.accepted, response.reason = reply.accepted, reply.reason
        return response


def why_message(response: Any, why: Why, resources: Any) -> Any:
    """Fill the service's response."""
    response.known, response.ready, response.reason, response.refusal = True, why.ready, why.reason, why.refusal
    for one in why.unmet:
        states = [(name, state, resources[name]) for name, state in one.states.items()]
        response.unmet.append(
            Unmet(
                name=one.name,
                condition=one.condition,
                reason=one.reason,
                resources=[
                    ResourceState(name=name, state=state, previous_state=s.previous, stamp_ns=s.stamp_ns) for name, state, s in states
                ],
                data=[data_message(name, value) for name, value in one.data.items()],
            )
        )
    response.history = [
        ResourceTransition(stamp_ns=e.stamp_ns, resource=e.resource, from_state=e.from_state, to_state=e.to_state, cause=e.cause)
        for e in why.history
    ]
    return response


def data_message(name: str, value: object) -> Any:
    """Return a data's value as a message; None for no fresh value."""
    return DataValue(name=name, value_json="" if value is None else json.dumps(to_plain(value)))
