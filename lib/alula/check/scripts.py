"""The scripts of a tree: read once each, what is wrong in them at its column."""

from __future__ import annotations

from collections.abc import Sequence

from alula.check.problems import in_value
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.script import Program, ScriptError, parse
from alula.trees.script.syntax import Node


class Scripts:
    """The scripts of a tree by their attributes."""

    def __init__(self) -> None:
        self._programs: dict[int, Program | None] = {}
        self._kept: list[Attribute] = []
        self.problems: list[Problem] = []

    def program(self, attribute: Attribute) -> Program | None:
        """Return the script in an attribute; None where it is wrong, which is a problem from then on."""
        if id(attribute) not in self._programs:
            self._kept.append(attribute)  # so that no other gets its id
            self._programs[id(attribute)] = self._read(attribute)
        return self._programs[id(attribute)]

    def statements(self, attribute: Attribute) -> Sequence[Node]:
        """Return the statements of the script in an attribute; none where it is wrong."""
        program = self.program(attribute)
        return program.statements if program else ()

    def _read(self, attribute: Attribute) -> Program | None:
        try:
            program = parse(attribute.value)
        except ScriptError as error:
            code = "ALU008" if error.excess else "ALU614"
            self.problems.append(in_value(code, attribute, (error.offset, error.end), f"the script: {error.message}", error.cure))
            return None
        for note in program.notes:
            self.problems.append(in_value("ALU616", attribute, (note.offset, note.end), note.message, note.cure, warning=True))
        return program
