"""Texts that entries are compared with and that no skill which writes them ends with: `driven == 'BLOKED'`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from alula.check.problems import in_value, of_value
from alula.check.skills import Skills
from alula.check.whole import Whole
from alula.common.suggestions import nearest, quoted
from alula.missions.skill_types import OUTCOME_PORT
from alula.model.execution_state import ExecutionState
from alula.model.model import Skill
from alula.trees.access import Key, scripts_of, takes_script_from_entry
from alula.trees.blackboard import Blackboard
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig, pointer
from alula.trees.script.syntax import Comparison, Conditional, Literal, Name, Node, walk

SWITCH, VARIABLE, CASE = "Switch", "variable", "case_"


@dataclass(frozen=True)
class OutcomeRules:
    """The rule of what is asked of the ends of skills; it takes a whole tree and yields problems."""

    skills: Skills

    def asked(self, whole: Whole) -> Iterator[Problem]:
        """Yield texts that an entry never has in which nothing but ends of skills and texts of the file are written."""
        written = _Written.of(self.skills, whole)
        if any(takes_script_from_entry(config.element, config.type) for one in (whole.root, *whole.beside) for config in one.walk()):
            return
        for config in whole.root.walk():
            for attribute, name, text, place in _compared(config, whole):
                key = config.blackboard.where(name)
                ends = written.ends.get(key)
                if not text or ends is None or key not in written.skills_of or key in written.anything or text in ends:
                    continue
                own = {one for one in ends if one not in _STATES}
                cure = nearest(text, ends)
                cure = cure if cure.startswith("did you mean") else f"it ends with {quoted(sorted(own))}, or as it failed"
                message = f"no skill that writes `{name}` ends with `{text}`: {quoted(sorted(written.skills_of[key]))}"
                yield of_value("ALU618", attribute, message, cure) if place is None else in_value("ALU618", attribute, place, message, cure)


_STATES = frozenset(state.value for state in ExecutionState if state.terminal)


def _ends(skill: Skill) -> frozenset[str]:
    """Return all that the outcome of a skill may be: a result, what was false, or the state in which it ended without one."""
    return _STATES | {one.name for several in (skill.results, skill.preconditions, skill.invariants) for one in several}


@dataclass
class _Written:
    """What is written into entries: ``ends`` of skills and texts of the file, by entry; ``anything`` where more than that is."""

    skills: Skills
    whole: Whole
    ends: dict[Key, set[str]] = field(default_factory=dict)
    skills_of: dict[Key, set[str]] = field(default_factory=dict)
    anything: set[Key] = field(default_factory=set)

    @classmethod
    def of(cls, skills: Skills, whole: Whole) -> _Written:
        """Read it of a tree, and of those on its blackboard."""
        found, board = cls(skills, whole), whole.root.blackboard
        found.anything.update(board.where(name) for name in whole.given or ())
        found.tree(whole.root)
        for root in whole.beside:
            other = cls(skills, whole)
            other.tree(root)
            found.take(other, board)
        if whole.given is None:  # who starts this tree may write whatever it likes
            found.anything.update(key for key in found.ends if key[0] is board)
        return found

    def tree(self, root: NodeConfig) -> None:
        """Add what a tree writes."""
        for config in root.walk():
            skill = self.skills.of(config)
            for access in self.whole.accesses.of_node(config):
                if not access.write:
                    continue
                if skill is not None and access.value is None and access.attribute.name == OUTCOME_PORT:
                    self.ends.setdefault(access.key, set()).update(_ends(skill))
                    self.skills_of.setdefault(access.key, set()).add(config.type.name)
                    continue
                for text in _texts(access.value):
                    if text is None:
                        self.anything.add(access.key)
                    else:
                        self.ends.setdefault(access.key, set()).add(text)
            for attribute in config.port_attributes() if config.type.unknown else ():
                key = pointer(attribute.value, attribute.name)
                self.anything.update([] if key is None else [config.blackboard.where(key)])

    def take(self, other: _Written, board: Blackboard) -> None:
        """Add what another tree writes on one blackboard."""
        self.anything.update(key for key in other.anything if key[0] is board)
        for mine, its in ((self.ends, other.ends), (self.skills_of, other.skills_of)):
            for key, several in its.items():
                if key[0] is board:
                    mine.setdefault(key, set()).update(several)


def _texts(value: Node | None) -> Iterator[str | None]:
    """Yield the texts of the file that an expression may be, None for anything else."""
    match value:
        case Literal(value=str(text)):
            yield text
        case Conditional(then=then, otherwise=otherwise):
            yield from _texts(then)
            yield from _texts(otherwise)
        case _:
            yield None


def _compared(config: NodeConfig, whole: Whole) -> Iterator[tuple[Attribute, str, str, tuple[int, int] | None]]:
    """Yield texts that a node compares an entry with: where it does, the entry, the text, and its place in a script."""
    for attribute in scripts_of(config.element, config.type):
        for node in _nodes_of(attribute, whole):
            match node:
                case Comparison(operands=(Name(name=name), Literal(value=str(text)) as one), operators=("==" | "!=",)):
                    yield attribute, name, text, (one.offset, one.end)
                case Comparison(operands=(Literal(value=str(text)) as one, Name(name=name)), operators=("==" | "!=",)):
                    yield attribute, name, text, (one.offset, one.end)
    variable = pointer(config.element.get(VARIABLE), VARIABLE) if config.type.name.startswith(SWITCH) else None
    for attribute in config.port_attributes() if variable is not None else ():
        if attribute.name.startswith(CASE) and pointer(attribute.value, attribute.name) is None:
            yield attribute, variable or "", attribute.value, None


def _nodes_of(attribute: Attribute, whole: Whole) -> Iterator[Node]:
    yield from (node for statement in whole.scripts.statements(attribute) for node in walk(statement))
