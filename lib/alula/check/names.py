"""What the models tell of the names in a mission's scripts: resources and their states, data and their fields, functions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from alula.check.problems import in_value
from alula.check.skills import Skills
from alula.check.whole import Whole
from alula.common.suggestions import nearest, quoted
from alula.language.messages import FieldError
from alula.missions.environment import FUNCTIONS
from alula.model.ros_types import PRIMITIVES
from alula.trees.access import scripts_of
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.script.syntax import Assignment, Call, Comparison, Literal, Name, Node, walk


@dataclass(frozen=True)
class NameRules:
    """The rules of names; each takes a whole tree and yields problems."""

    skills: Skills

    def names(self, whole: Whole) -> Iterator[Problem]:
        """Yield dotted names, states and functions in scripts that nothing of the robot has."""
        for config in whole.root.walk():
            for attribute in scripts_of(config.element, config.type):
                for statement in whole.scripts.statements(attribute):
                    yield from self._unguarded(attribute, statement)
                    asked: set[int] = set()
                    for node in walk(statement):
                        yield from self._node(attribute, node, asked)

    def _node(self, attribute: Attribute, node: Node, asked: set[int]) -> Iterator[Problem]:
        match node:
            case Call():
                asked |= {id(argument) for argument in node.arguments}
                yield from self._call(attribute, node)
            case Comparison():
                yield from self._states(attribute, node)
                yield from self._compared(attribute, node)
            case Name(name=name) if "." in name and id(node) not in asked:
                yield from self._dotted(attribute, node)

    def _call(self, attribute: Attribute, node: Call) -> Iterator[Problem]:
        place = (node.offset, node.offset + len(node.function))
        function = FUNCTIONS.get(node.function)
        if function is None:
            yield in_value("ALU615", attribute, place, f"there is no function `{node.function}`", nearest(node.function, FUNCTIONS))
            return
        kind = function.kind
        name = _name_of(node.arguments[0]) if len(node.arguments) == 1 else None
        if name is None and (len(node.arguments) != 1 or isinstance(node.arguments[0], Literal)):
            yield in_value("ALU615", attribute, place, f"`{node.function}` takes one name", f"the name of one {kind}")
        elif name is not None and name not in self.skills.names[kind]:
            one = node.arguments[0]
            cure = nearest(name, self.skills.names[kind])
            yield in_value("ALU615", attribute, (one.offset, one.end), f"there is no {kind} `{name}`", cure)

    def _dotted(self, attribute: Attribute, node: Name) -> Iterator[Problem]:
        skillset_name, _, name = node.name.partition(".")
        place = (node.offset, node.end)
        skillset = self.skills.skillsets.get(skillset_name)
        if skillset is None:
            cure = nearest(skillset_name, self.skills.skillsets)
            yield in_value("ALU615", attribute, place, f"there is no skillset `{skillset_name}`", cure)
        elif name.partition(".")[0] in skillset.data_index:
            problem = self._field(node.name)
            if problem is not None:
                yield in_value("ALU615", attribute, place, *problem)
        elif name not in skillset.resource_index:
            cure = nearest(name, {*skillset.resource_index, *skillset.data_index})
            yield in_value("ALU615", attribute, place, f"`{skillset_name}` has no resource and no data `{name}`", cure)

    def _field(self, name: str) -> tuple[str, str] | None:
        """Return what is wrong with the name of a field of data, and the cure."""
        skillset, data, *path = name.split(".")
        type_ = self.skills.skillsets[skillset].data_index[data].type
        if type_ in PRIMITIVES:
            return (f"`{skillset}.{data}` has no fields", f"write `{skillset}.{data}`") if path else None
        try:
            found = self.skills.messages.field(type_, path)
        except FieldError as error:
            return f"`{skillset}.{data}`: {error}", error.cure
        single = bool(path) and (found is None or (not found.package and not found.array))
        return None if single else (f"`{name}` is no single value", f"name a field: `{name}.FIELD`")

    def _kind(self, node: Node) -> str | None:
        """Return the Python type of data, empty where it is not known; None of what is no data."""
        if not isinstance(node, Name) or ".".join(node.name.split(".", 2)[:2]) not in self.skills.names["data"]:
            return None
        skillset, data, *path = node.name.split(".")
        with suppress(FieldError):
            found = self.skills.messages.field(self.skills.skillsets[skillset].data_index[data].type, path)
            return PRIMITIVES.get(found.interface, "") if found else ""
        return ""

    def _compared(self, attribute: Attribute, node: Comparison) -> Iterator[Problem]:
        """Yield what data can't be compared with."""
        for one in node.operands:
            kind = self._kind(one)
            shown = one.name if isinstance(one, Name) else ""
            for other in node.operands if kind is not None else ():
                place = (other.offset, other.end)
                if isinstance(other, Name) and other.name in self.skills.states:
                    cure = "write a text in quotes, and a number as it is"
                    yield in_value("ALU605", attribute, place, f"`{shown}` is data, and `{other.name}` is a resource's state", cure)
                elif isinstance(other, Literal) and kind and isinstance(other.value, str) != (kind == "str"):
                    cure = "compare it with a text: `'...'`" if kind == "str" else "compare it with a number, in the data's unit"
                    is_what = {"str": "a text", "bool": "true or false"}.get(kind, "a number")
                    yield in_value("ALU605", attribute, place, f"`{shown}` is {is_what}, and is compared with {other.value!r}", cure)

    def _unguarded(self, attribute: Attribute, statement: Node) -> Iterator[Problem]:
        """Yield data that an assignment takes: they may be unknown when it does, and then it can't."""
        if isinstance(statement, Assignment):
            for node in walk(statement.value):
                data = ".".join(node.name.split(".", 2)[:2]) if isinstance(node, Name) else ""
                if data in self.skills.names["data"] and not self._asked_only(statement.value, node):
                    message = f"`{data}` may have no fresh value here, and an entry takes no unknown one"
                    yield in_value("ALU615", attribute, (node.offset, node.end), message, "ask for data in conditions")

    def _asked_only(self, value: Node, name: Node) -> bool:
        """Return whether a name is but an argument, such as that of `fresh`."""
        return any(isinstance(call, Call) and any(one is name for one in call.arguments) for call in walk(value))

    def _states(self, attribute: Attribute, node: Comparison) -> Iterator[Problem]:
        for one in node.operands:
            states = self._states_of(one)
            for other in node.operands if states else ():
                if other is one or not isinstance(other, Name | Literal) or (isinstance(other, Name) and "." in other.name):
                    continue
                name = other.name if isinstance(other, Name) else str(other.value)
                if name not in states:
                    shown = one.name if isinstance(one, Name) else ""
                    cure = nearest(name, states) or f"it has {quoted(states)}"
                    yield in_value("ALU615", attribute, (other.offset, other.end), f"`{shown}` has no state `{name}`", cure)

    def _states_of(self, node: Node) -> tuple[str, ...]:
        if not isinstance(node, Name) or node.name.count(".") != 1:
            return ()
        skillset, name = node.name.split(".")
        known = self.skills.skillsets.get(skillset)
        return known.resource_index[name].states if known and name in known.resource_index else ()


def _name_of(node: Node) -> str | None:
    """Return the name that an argument is, bare or as a text; None where it is computed."""
    if isinstance(node, Name):
        return node.name
    return node.value if isinstance(node, Literal) and isinstance(node.value, str) else None
