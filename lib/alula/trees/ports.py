"""Ports of nodes: what a type of node reads and writes, as its class or a TreeNodesModel declares it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from alula.common.public import public
from alula.trees.errors import Place
from alula.trees.values import ANY, STRING, PortType


class Direction(Enum):
    """Whether a port is read, written, or both; as in a TreeNodesModel."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    INOUT = "inout_port"


@public("alula.trees")
@dataclass(frozen=True)
class Port:
    """A port of a type of node; ``default`` is text as in a file, None: none; ``unit`` is that of a number, as ``m/s``."""

    name: str
    type: PortType = ANY
    direction: Direction = Direction.INPUT
    default: str | None = None
    doc: str = ""
    unit: str = ""
    required: bool = False
    """Whether a file has to set it. Without a port that is not required a node still works, or raises TickError in a tick."""
    optional: bool = False
    """Whether the node works without it, and without a value of the entry that it names."""
    unchecked: bool = False
    """Whether the node reads it without checking that there is a value, and goes on with an empty one."""
    script: bool = False
    """Whether its text is a script, or names an entry that holds one."""
    may_be_empty: bool = False
    """Whether an empty script is allowed, and does nothing."""
    written_from: str = ""
    """The port whose value is written to the entry that a plain text names; empty: a plain text is a value."""
    place: Place | None = field(default=None, compare=False, repr=False)
    """The place of the default in a file."""


@public("alula.trees")
def input_port(
    name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "", optional: bool = False
) -> Port:
    """Return a port that is read."""
    return Port(name, type_, Direction.INPUT, default, doc, unit, optional=optional)


@public("alula.trees")
def output_port(name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "") -> Port:
    """Return a port that is written; it has to name an entry of the blackboard."""
    return Port(name, type_, Direction.OUTPUT, default, doc, unit)


@public("alula.trees")
def inout_port(name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "") -> Port:
    """Return a port that is read and written."""
    return Port(name, type_, Direction.INOUT, default, doc, unit)


@public("alula.trees")
def script_port(name: str, doc: str = "", *, may_be_empty: bool = False) -> Port:
    """Return a port whose text is a script, for `Node.script` to compile; checks and proofs read which entries it uses."""
    return Port(name, STRING, doc=doc, script=True, may_be_empty=may_be_empty)
