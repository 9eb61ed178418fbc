"""The Python of a robot from trees: classes that stand in for nodes with children, and the reader of its worlds."""

from __future__ import annotations

import re
from collections.abc import Iterator

from alula.adopt.vocabulary import StandIn, Vocabulary
from alula.trees.node_type import Category
from alula.trees.ports import Direction

TRIES = re.compile(r"(?i)fallback|selector|recover|try|alternative")
"""In the name of a node with children: the next one's turn comes when one has failed."""
MAKERS = {Direction.INPUT: "input_port", Direction.OUTPUT: "output_port", Direction.INOUT: "inout_port"}
HEAD = '''"""What missions of this robot have besides skills: nodes with children of its own, and what is on the blackboard at the start."""

from __future__ import annotations

from pathlib import Path

import yaml

from alula.parts import Inputs, MissionPart
from alula.trees import {names}


def read_inputs(path: Path) -> Inputs:
    """Read the file of a world: entries by their names."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))
'''
DECORATOR = '''

class PassThrough(Decorator):
    """Answers what its child does. As it does not tell proofs how it ends and ticks, they allow for everything."""

    told = ()

    def update(self) -> Answer:
        """Write something to each output that it has, and tick the child."""
        for port in self.told:
            self.put(port, "")
        return self.child.execute()
'''
CONTROL = '''

class InTurn(Control):
    """Ticks its children in turn, up to one that does not answer ``goes_on``. As it does not tell proofs, they allow for everything."""

    goes_on, told = SUCCESS, ()

    def update(self) -> Answer:
        """Write something to each output that it has, and go on with the child that runs, or the next one."""
        for port in self.told:
            self.put(port, "")
        for child in self.children:
            if child.status is self.goes_on:
                continue
            answer = child.execute()
            if answer is RUNNING:
                return answer
            if answer is not self.goes_on and answer is not SKIPPED:
                self.reset_children()
                return answer
        self.reset_children()
        return self.goes_on
'''


def module_text(vocabulary: Vocabulary) -> str:
    """Return the robot's module."""
    stand_ins = list(vocabulary.stand_ins.values())
    decorators = [one for one in stand_ins if one.type.category is Category.DECORATOR]
    controls = [one for one in stand_ins if one.type.category is Category.CONTROL]
    names = {"Answer", "register"} if stand_ins else set()
    names |= {"Decorator"} if decorators else set()
    names |= {"Control", "RUNNING", "SKIPPED", "SUCCESS"} if controls else set()
    names |= {"FAILURE"} if any(map(_tries, controls)) else set()
    names |= {MAKERS[port.direction] for one in stand_ins for port in one.type.ports.values()}
    text = HEAD.format(names=", ".join(sorted(names)))
    if not stand_ins:
        text = text.replace("from alula.trees import \n", "")
    text += (DECORATOR if decorators else "") + (CONTROL if controls else "")
    text += "".join("\n".join(_class(one)) for one in stand_ins)
    nodes = "".join(f"{one.class_name}, " for one in stand_ins).rstrip(" ")
    return f"{text}\n\nPART = MissionPart(nodes=({nodes}))\n"


def _tries(one: StandIn) -> bool:
    return one.type.category is Category.CONTROL and TRIES.search(one.type.name) is not None


def _class(one: StandIn) -> Iterator[str]:
    base = "PassThrough" if one.type.category is Category.DECORATOR else "InTurn"
    yield "\n"
    yield f"@register({one.name!r})"
    yield f"class {one.class_name}({base}):"
    yield f'    """Stands in for {one.type.name}: write what it does."""'
    yield ""
    ports = [f"{MAKERS[port.direction]}({port.name!r}{_default(port.default)})" for port in one.type.ports.values()]
    if ports:
        yield f"    ports = ({', '.join(ports)},)"
    outputs = [port.name for port in one.type.ports.values() if port.direction is not Direction.INPUT]
    if outputs:
        yield f"    told = ({', '.join(map(repr, outputs))},)"
    if _tries(one):
        yield "    goes_on = FAILURE"
    yield ""


def _default(default: str | None) -> str:
    return "" if default is None else f", default={default!r}"
