"""The services that answer questions and take wishes: ``why`` and ``pause``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from skillset_interfaces.srv import SetPaused
from skillset_interfaces.srv import Why as WhyService

from skill_runtime.core.engine import PauseReply, SkillsetEngine
from skill_runtime.messages import fill_why
from skill_runtime.ros2.deferred import Deferral
from skill_runtime.workers import Workers

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
        self._deferral = Deferral(node)
        node.create_service(WhyService, f"{name}/why", self._why, callback_group=self._deferral.group)
        node.create_service(SetPaused, f"{name}/pause", self._pause, callback_group=self._deferral.group)

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
        return fill_why(response, self._engine.explain(request.skill, refusal), self._engine.resources)

    async def _validated(self, skill: str, inputs: object) -> str:
        def start(give: Callable[[str], None]) -> None:
            self._workers.submit(lambda: self._engine.ask_validate(skill, inputs, give))

        return await self._deferral.within(start, HOOK_ANSWERS_S, f"validate has not answered for {HOOK_ANSWERS_S:g} s")

    async def _pause(self, request: Any, response: Any) -> Any:
        def start(give: Callable[[PauseReply], None]) -> None:
            self._workers.submit(lambda: self._engine.set_paused(request.id, give, paused=request.paused))

        silent = PauseReply(accepted=False, reason=f"the hook has not answered for {HOOK_ANSWERS_S:g} s")
        reply = await self._deferral.within(start, HOOK_ANSWERS_S, silent)
        response.accepted, response.reason = reply.accepted, reply.reason
        return response
