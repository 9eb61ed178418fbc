"""What skills and resources are in a running mission: nodes that call a robot's clients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from alula.missions.context import MissionContext
from alula.missions.leaves import SkillLeaf
from alula.missions.skill_types import HALT_PORT, OUTCOME_PORT, SEPARATOR, STATE_PORT, SUCCESS_PORT, resource_type, skill_type
from alula.missions.skillset import Client
from alula.model.execution_state import ExecutionState
from alula.model.model import Resource, Skill, Skillset
from alula.trees.ends import ENDS, FAILS, Ends, Given
from alula.trees.node import Action, Condition, NodeConfig, tickable
from alula.trees.registry import NodeRegistry
from alula.trees.status import FAILURE, IDLE, RUNNING, SUCCESS, Answer


@dataclass(frozen=True)
class Crew:
    """What the skills of a mission are called by."""

    clients: Mapping[str, Client]
    context: MissionContext


class SkillNode(Action):
    """One skill: started with its inputs, watched, interrupted when the tree halts it.

    A result that the model calls a success is one, or those that ``success`` names; every other end is a failure. ``outcome`` is written
    when it has ended: the result, or the precondition or invariant that did not hold, or the state. A halt asks for the interruption and
    does not wait: until it has ended, a start in the same skillset waits, RUNNING, so nothing is left behind; with ``halt_waits``
    a start in any skillset does. The tree goes on without the end of what it halts, so ``outcome`` is INTERRUPTED from the halt on,
    whatever comes of it; only what had ended since the last tick has its own outcome and outputs.
    """

    ends = ENDS

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """Fail at any time, as it may be refused, interrupted, or stopped by an invariant; succeed where a result is a success."""
        return cls.ends if given(SUCCESS_PORT) else FAILS

    def __init__(self, config: NodeConfig, model: Skill, skillset: str, crew: Crew) -> None:
        super().__init__(config)
        self.crew = crew
        self.model = model
        self.skillset = skillset
        client = self.crew.clients[self.skillset]
        success = str(self.get(SUCCESS_PORT)).split(SEPARATOR)
        self.leaf: SkillLeaf[MissionContext] = SkillLeaf(
            self.name,
            client,
            self.model.name,
            self._inputs,
            context=self.crew.context,
            success=frozenset(success) - {""},
            halt_waits=bool(self.get(HALT_PORT)),
        )

    def on_start(self) -> Answer:
        """Start it, or wait until it may start."""
        self.leaf.initialise()
        return self.on_running()

    def on_running(self) -> Answer:
        """Follow it."""
        answer: Answer = self.leaf.update()
        self.feedback_message = self.leaf.feedback_message
        if answer is not RUNNING:
            self._tell_end()
        return answer

    def on_halted(self) -> None:
        """Ask for its interruption, and say so; ``_onHalted`` finds it said."""
        self.leaf.terminate(IDLE)
        self.feedback_message = self.leaf.feedback_message
        self._tell_end()

    def _tell_end(self) -> None:
        handle = self.leaf.handle
        if handle is None or not handle.done:
            self.put(OUTCOME_PORT, ExecutionState.INTERRUPTED.value)
            return
        self.put(OUTCOME_PORT, handle.result or handle.state.value)
        for name, value in handle.outputs.items():
            self.put(name, value)

    @property
    def running(self) -> bool:
        """Return whether its execution is RUNNING."""
        handle = self.leaf.handle
        return handle is not None and handle.state is ExecutionState.RUNNING

    @property
    def progress(self) -> float:
        """Its progress while it is RUNNING, else 0."""
        return self.leaf.handle.progress if self.running and self.leaf.handle is not None else 0.0

    def _inputs(self, _: MissionContext) -> Mapping[str, object]:
        return {one.name: self.get(one.name) for one in self.model.inputs if self.given(one.name)}


class ResourceNode(Condition):
    """Succeeds when a resource is in a state."""

    ends = ENDS

    def __init__(self, config: NodeConfig, model: Resource, skillset: str, crew: Crew) -> None:
        super().__init__(config)
        self.crew = crew
        self.model = model
        self.skillset = skillset

    def update(self) -> Answer:
        """Ask."""
        state = self.crew.clients[self.skillset].resources.get(self.model.name)
        return SUCCESS if state == self.get(STATE_PORT) else FAILURE


def robot_nodes(skillsets: Sequence[Skillset], crew: Crew | None = None) -> NodeRegistry:
    """Return skills as actions, and resources as conditions; without a crew they can be checked and drawn, and not be ticked."""
    registry = NodeRegistry()
    for one in skillsets:
        # No class for each: isinstance asks every subclass of a base that there is, and a campaign makes missions by the thousand.
        for skill in one.skills:
            known = replace(skill_type(one.name, skill), tells=SkillNode)
            registry.add(known if crew is None else tickable(known, partial(SkillNode, model=skill, skillset=one.name, crew=crew)))
        for resource in one.resources:
            known = replace(resource_type(one.name, resource), tells=ResourceNode)
            registry.add(known if crew is None else tickable(known, partial(ResourceNode, model=resource, skillset=one.name, crew=crew)))
    return registry
