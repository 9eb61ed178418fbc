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
    """A port: ``default`` is text as in a file, None where there is none; ``unit`` is of a number, as ``m/s``."""

    name: str
    type: PortType = ANY
    direction: Direction = Direction.INPUT
    default: str | None = None
    doc: str = ""
    unit: str = ""
    required: bool = False
    """A file has to give it; else a node does without it, or says so when it is ticked."""
    optional: bool = False
    """The node does without it, and without a value of the entry that it names."""
    unchecked: bool = False
    """The node reads it without looking whether there is a value: it goes on with an empty one."""
    script: bool = False
    """Its text is a script, unless it names an entry that has one."""
    may_be_empty: bool = False
    """A script that is empty does nothing; another node's is wrong then."""
    written_from: str = ""
    """A plain text names an entry, too, which gets what this other port says; empty: a plain text is a value."""
    place: Place | None = field(default=None, compare=False, repr=False)
    """Where a file says its default."""


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
    """Return a port whose text is a script, which `Node.script` compiles: what it reads and writes is known before it is run."""
    return Port(name, STRING, doc=doc, script=True, may_be_empty=may_be_empty)
