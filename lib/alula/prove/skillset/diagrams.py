"""A skillset in binary decision diagrams (CUDD by way of ``dd``): its variables, its terms, and its steps on sets of situations.

A step of this language is a guard and constants: whatever fulfils the guard has these variables set to these values. A
set is moved forwards by forgetting the variables and fixing them, and backwards by putting the constants in; no relation
between old and new variables is ever built.

Variables: the bits of each resource's state; for each skill ``runs k``: at least k executions run; for each invariant
``broken``: its skill's executions are found broken by it and not yet ended (only within a step).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from alula.model.expressions import And, Constant, Expression, Implies, Not, Or, ResourceIs, SkillRuns
from alula.model.model import Effect, Skillset
from alula.model.transitions import origins, targets_of

ENDED = "ended"
"""A variable that marks, where it matters, the steps that end a certain skill."""


@dataclass(frozen=True)
class Update:
    """Situations that fulfil ``guard`` get these values; ``changed`` are the resources among them, ``ends`` the skill that it ends."""

    guard: Any
    values: Mapping[str, bool]
    changed: tuple[str, ...] = ()
    ends: str = ""
    touches: str = ""
    """The skill that it starts or finds broken."""


@dataclass(frozen=True)
class Within:
    """Situations within a step, in which the variable ``broken`` is true; ``about`` are the resources that decide."""

    broken: str
    situations: Any
    about: tuple[str, ...]


@dataclass
class Encoded:
    """A skillset in diagrams: its steps, its marks (which invariant breaks first) and violations, and what can go wrong."""

    skillset: Skillset
    bdd: Any
    copies: Mapping[str, int] = field(default_factory=dict)
    steps: list[Update] = field(default_factory=list)
    marks: dict[str, list[tuple[str, Any]]] = field(default_factory=dict)
    """For each skill: the variable ``broken`` and the situations in which this invariant is its first false one."""
    violations: dict[str, list[Update]] = field(default_factory=dict)
    """For each variable ``broken``: what ends one execution."""
    watchers: dict[str, list[str]] = field(default_factory=dict)
    """For each resource the skills with an invariant about it."""
    faults: dict[tuple[str, ...], Any] = field(default_factory=dict)
    """Situations that show a fault before the step; those of ``inner`` show it within one."""
    inner: dict[tuple[str, ...], Within] = field(default_factory=dict)
    startable: dict[str, Any] = field(default_factory=dict)
    crowded: dict[str, Any] = field(default_factory=dict)

    # --- terms ----------------------------------------------------------------------------------------------------

    def values_of(self, resource: str, state: str) -> dict[str, bool]:
        """Return the bits of a state."""
        number = self.skillset.resource(resource).states.index(state)
        return {name: bool(number >> bit & 1) for bit, name in enumerate(bits(self.skillset, resource))}

    def is_state(self, resource: str, state: str) -> Any:
        """Return the situations with a resource in a state."""
        if state not in self.skillset.resource(resource).states:
            return self.bdd.false
        return self.bdd.cube(self.values_of(resource, state))

    def runs(self, skill: str, count: int = 1) -> Any:
        """Return the situations in which at least ``count`` executions of a skill run."""
        return self.bdd.var(runs_name(skill, count)) if count <= self.copies[skill] else self.bdd.false

    def term(self, condition: Expression) -> Any:
        """Return the situations that fulfil a condition over resources and executions."""
        match condition:
            case ResourceIs(resource=resource, state=state, negated=negated):
                same = self.is_state(resource, state)
                return ~same if negated else same
            case SkillRuns(skill=skill):
                return self.runs(skill)
            case Constant(value=value):
                return self.bdd.true if value else self.bdd.false
            case Not(operand=operand):
                return ~self.term(operand)
            case And(operands=operands):
                return self.all_of(self.term(operand) for operand in operands)
            case Or(operands=operands):
                return self.any_of(self.term(operand) for operand in operands)
            case Implies(premise=premise, conclusion=conclusion):
                return ~self.term(premise) | self.term(conclusion)
            case _:
                raise ValueError(f"no set of situations can ask data: {condition}")

    def all_of(self, terms: Iterable[Any]) -> Any:
        """Return the intersection of sets."""
        result = self.bdd.true
        for term in terms:
            result &= term
        return result

    def any_of(self, terms: Iterable[Any]) -> Any:
        """Return the union of sets."""
        result = self.bdd.false
        for term in terms:
            result |= term
        return result

    def applies(self, effect: Effect, *, by_event: bool = False) -> Any:
        """Return the situations in which every change of an effect is possible."""
        return self.all_of(
            self.any_of(self.is_state(name, source) for source in origins(self.skillset.resource(name), targets, any_transition=by_event))
            for name, targets in targets_of(effect).items()
        )

    def changes(self, effect: Effect) -> dict[str, bool]:
        """Return the values that an effect sets, by variable."""
        values: dict[str, bool] = {}
        for change in effect.assignments:
            if change.target in self.skillset.resource(change.resource).states:
                values |= self.values_of(change.resource, change.target)
        return values


def bits(skillset: Skillset, resource: str) -> list[str]:
    """Return the variables of a resource."""
    count = max(1, (len(skillset.resource(resource).states) - 1).bit_length())
    return [f"resource {resource} {bit}" for bit in range(count)]


def runs_name(skill: str, count: int) -> str:
    """Return the variable that is true while at least ``count`` executions run."""
    return f"runs {skill} {count}"


def broken_name(skill: str, invariant: str) -> str:
    """Return the variable that is true while an invariant is broken and its executions have not ended yet."""
    return f"broken {skill} {invariant}"
