"""Skills and resources of a robot's models as types of node: what a mission's file may name, and what ports it has."""

from __future__ import annotations

from collections.abc import Callable

from alula.model.model import Parameter, Resource, ResultKind, Skill
from alula.model.units import told_unit
from alula.trees.node_type import Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.values import ANY, BOOL, DOUBLE, INT, SIZED, STRING, UINT, PortType, shown

SUCCESS_PORT = "success"
OUTCOME_PORT = "outcome"
HALT_PORT = "halt_waits"
STATE_PORT = "state"
SEPARATOR = ";"
"""Between the results that a port names."""
PORT_TYPES = {"bool": BOOL, "int32": INT, "uint32": UINT, "float32": DOUBLE, "float64": DOUBLE, "string": STRING, **SIZED}
"""Types of ports for primitive types of the models."""


def skill_type(skillset: str, skill: Skill, doc: str = "") -> NodeType:
    """Return a skill's: its inputs and outputs, which results are a success, and what to write of its end."""
    successes = SEPARATOR.join(one.name for one in skill.results if skill.kind_of(one.name) is ResultKind.SUCCESS)
    results = ", ".join(one.name for one in skill.results)
    ports = [
        *(_port(one, Direction.INPUT) for one in skill.inputs),
        *(_port(one, Direction.OUTPUT) for one in skill.outputs),
        Port(
            SUCCESS_PORT, STRING, Direction.INPUT, successes, f"results that mean success, of {results}" if results else "it has no results"
        ),
        Port(HALT_PORT, BOOL, Direction.INPUT, "false", "when it is halted, no skill of any skillset starts until it has ended"),
        Port(OUTCOME_PORT, STRING, Direction.OUTPUT, None, "why it ended: its result, or how it failed"),
    ]
    return node_type(f"{skillset}.{skill.name}", Category.ACTION, ports, doc=doc)


def resource_type(skillset: str, resource: Resource) -> NodeType:
    """Return a resource's: a condition that asks for its state."""
    port = Port(STATE_PORT, STRING, Direction.INPUT, None, f"one of {', '.join(resource.states)}", required=True)
    return node_type(f"{skillset}.{resource.name}", Category.CONDITION, [port], doc=f"asks for the state of {resource.name}")


def _port(parameter: Parameter, direction: Direction) -> Port:
    required = direction is Direction.INPUT and not parameter.default
    kind = type_of(parameter.type)
    return Port(
        parameter.name, kind, direction, parameter.default or None, parameter.comment, told_unit(parameter.comment), required=required
    )


def type_of(name: str) -> PortType:
    """Return the type of a port for a type of the models; what is no primitive has its name and takes any value but text."""
    return PORT_TYPES.get(name) or PortType(name, _no_text(name), ANY.cast)


def _no_text(name: str) -> Callable[[str], object]:
    def refuse(text: str) -> object:
        msg = f"{shown(text)} is no {name}; a {name} comes from an entry: {{entry}}"
        raise ValueError(msg)

    return refuse
