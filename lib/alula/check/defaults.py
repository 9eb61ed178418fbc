"""Defaults of ports in a TreeNodesModel: a mission's parameters are numbers, and any other default is of its port's type."""

from __future__ import annotations

import re
from collections.abc import Iterator

from alula.trees.errors import Problem
from alula.trees.node import pointer
from alula.trees.node_type import NodeType
from alula.trees.ports import Port
from alula.trees.reading import TreeFiles
from alula.trees.values import ANY, DOUBLE

_WITH_UNIT = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?\s*[^\W\d]\S*\s*")


def wrong_defaults(files: TreeFiles, *, foreign: bool) -> Iterator[Problem]:
    """Yield defaults that can't be read; of the nodes of a ``foreign`` mission their program has its own."""
    for model in files.models.values():
        mission = model.name == files.main and not files.is_part
        for port in model.ports.values() if mission or not foreign else ():
            yield from _wrong(model, port, mission=mission)


def _wrong(model: NodeType, port: Port, *, mission: bool) -> Iterator[Problem]:
    type_ = DOUBLE if mission else port.type
    text = port.default
    if not text or port.place is None or type_ is ANY or pointer(text, port.name) is not None:
        return
    try:
        type_.parse(text)
    except ValueError as error:
        whose = "the mission's port" if mission else f"the port of '{model.name}'"
        cure = "write the number alone, in the port's unit" if _WITH_UNIT.fullmatch(text) else f"write a value of the type {type_.name}"
        yield Problem(port.place, f"the default of {whose} '{port.name}': {error}", cure, "ALU605", len(text), warning=not mission)
