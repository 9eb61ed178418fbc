"""Leaves that are skills: a type of node for each, with the ports that its model gives it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from alula.missions.blackboard import Blackboard
from alula.missions.leaves import SkillLeaf
from alula.missions.skillset import Client
from alula.model.execution_state import ExecutionState
from alula.model.model import Parameter, ResultKind, Skill, Skillset
from alula.trees.node import Action, Wiring
from alula.trees.palette import CHILDREN, Category, Direction, NodeType, Palette, Port, input_port, output_port
from alula.trees.status import IDLE, Answer
from alula.trees.values import BOOL, DOUBLE, STRING, PortType, whole

NUMBERS: Mapping[str, PortType] = {
    "float64": DOUBLE,
    "float32": DOUBLE,
    "bool": BOOL,
    "string": STRING,
    **{f"int{bits}": whole(f"int{bits}", -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": whole(f"uint{bits}", 0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
SUCCESS_PORT = "success"
OUTCOME_PORT = "outcome"


@dataclass(frozen=True)
class Crew:
    """What the skills of a mission are called by."""

    clients: Mapping[str, Client]
    memory: Blackboard


class SkillNode(Action):
    """One skill: started with its inputs, watched, interrupted when the tree halts it.

    A result that the model calls a success is one, or those that ``success`` names; every other end is a failure. ``outcome`` is written
    when it has ended: the result, or the precondition or invariant that did not hold, or the state. A halt asks for the interruption and
    does not wait: until it has ended, a start in the same skillset waits, RUNNING, so nothing is left behind.
    """

    crew: Crew
    model: Skill
    skillset: str

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        client = self.crew.clients[self.skillset]
        success = str(self.get(SUCCESS_PORT)).split(";") if self.given(SUCCESS_PORT) else successes(self.model)
        self.leaf: SkillLeaf[Blackboard] = SkillLeaf(
            self.name, client, self.model.name, self._inputs, blackboard=self.crew.memory, success=frozenset(success) - {""}
        )

    def on_start(self) -> Answer:
        """Start it, or wait until it may start."""
        self.leaf.initialise()
        return self.on_running()

    def on_running(self) -> Answer:
        """Follow it."""
        answer: Answer = self.leaf.update()
        self.feedback_message = self.leaf.feedback_message
        handle = self.leaf.handle
        if handle is not None and handle.done:
            self.put(OUTCOME_PORT, handle.result or handle.state.value)
        return answer

    def on_halted(self) -> None:
        """Ask for its interruption."""
        self.leaf.terminate(IDLE)
        self.feedback_message = self.leaf.feedback_message

    @property
    def running(self) -> bool:
        """Tell whether its execution is RUNNING."""
        handle = self.leaf.handle
        return handle is not None and handle.state is ExecutionState.RUNNING

    @property
    def progress(self) -> float:
        """Its progress while it is RUNNING, else 0."""
        return self.leaf.handle.progress if self.running and self.leaf.handle is not None else 0.0

    def _inputs(self, _: Blackboard) -> Mapping[str, object]:
        return {one.name: self.get(one.name) for one in self.model.inputs if self.given(one.name)}


def successes(skill: Skill) -> list[str]:
    """Return the results that the model calls a success."""
    return [result.name for result in skill.results if skill.kind_of(result.name) is ResultKind.SUCCESS]


def skill_types(skillsets: Iterable[Skillset], crew: Crew | None = None) -> Palette:
    """Return a type of node for each skill; without a crew they can be checked and drawn, and not be ticked."""
    return Palette(_type(skillset.name, skill, crew) for skillset in skillsets for skill in skillset.skills)


def _type(skillset: str, skill: Skill, crew: Crew | None) -> NodeType:
    name = f"{skillset}.{skill.name}"
    ports = {one.name: _port(one) for one in skill.inputs}
    ports[SUCCESS_PORT] = input_port(SUCCESS_PORT, STRING, doc="results that are a success, with semicolons between them")
    ports[OUTCOME_PORT] = output_port(OUTCOME_PORT, STRING, doc="how it ended")
    make = (
        None
        if crew is None
        else type(name, (SkillNode,), {"crew": crew, "model": skill, "skillset": skillset, "__doc__": SkillNode.__doc__})
    )
    return NodeType(name, Category.ACTION, ports, "", make, CHILDREN[Category.ACTION])


def _port(one: Parameter) -> Port:
    type_ = NUMBERS.get(one.type) or PortType(one.type, _no_text(one.type), _as_it_is)
    return Port(one.name, type_, Direction.INPUT, one.default or None, one.comment, required=not one.default)


def _no_text(name: str) -> Callable[[str], object]:
    def parse(text: str) -> object:
        msg = f"'{text}' is no {name}: name an entry that has one, as {{entry}}"
        raise ValueError(msg)

    return parse


def _as_it_is(value: object) -> object:
    return value
