"""The shortest courses of skills from one situation to a goal, when nothing fails: a search over the models' own steps, breadth first.

A skill takes its steps as managers take them (`model.semantics`), with all data as they should be. A success brings about what its effects
say, what the skill achieves, and what its mock brings about in the functional layer. Roles that it needs have to be filled meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.model import semantics
from alula.model.conditions import in_si
from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Comparison, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, atoms
from alula.model.model import Skillset
from alula.model.overapproximation import over_approximate
from alula.model.situation import Entered, Running, Situation
from alula.repair.purposes import Purpose, Purposes

MOST_STEPS = 8
MOST_SITUATIONS = 20_000

States = Mapping[str, str]
"""The states of all resources, by ``skillset.resource``."""
Fact = tuple[str, DataIs]
"""What is known of data: the skillset, and a condition that is true."""
Wanted = tuple[str, Expression]
"""A condition, and the skillset whose names it has; none: it names them itself."""


@dataclass(frozen=True)
class Here:
    """The states and facts between two skills of a course."""

    states: States
    facts: frozenset[Fact] = frozenset()

    @property
    def key(self) -> tuple[frozenset[tuple[str, str]], frozenset[Fact]]:
        """The key by which situations are compared."""
        return frozenset(self.states.items()), self.facts

    def fulfils(self, wanted: Wanted) -> bool:
        """Return whether a condition is true; one over data is true only where a fact implies it."""
        skillset, condition = wanted
        match condition:
            case ResourceIs(resource=name, state=state, negated=negated):
                return (self.states.get(f"{skillset}.{name}" if skillset else name) == state) != negated
            case DataIs():
                return any(of == skillset and _implies(fact, condition) for of, fact in self.facts)
            case Constant(value=value):
                return value
            case Not(operand=operand):
                return not self.fulfils((skillset, operand))
            case And(operands=operands):
                return all(self.fulfils((skillset, one)) for one in operands)
            case Or(operands=operands):
                return any(self.fulfils((skillset, one)) for one in operands)
            case Implies(premise=premise, conclusion=conclusion):
                return not self.fulfils((skillset, premise)) or self.fulfils((skillset, conclusion))
            case _:
                return False


@dataclass(frozen=True)
class Course:
    """Skills, one after another, with the situation before each of them and after the last one."""

    steps: tuple[Purpose, ...]
    heres: tuple[Here, ...]

    def told_between(self, number: int, wanted: Wanted | None = None) -> list[tuple[str, str]]:
        """Return the states that the functional layer has to report after a step, before the next step or a condition can be true.

        Each is ``skillset.resource`` and its state.
        """
        before, after = self.heres[number], self.heres[number + 1]
        asked = [wanted] if wanted is not None else []
        if number + 1 < len(self.steps):
            step = self.steps[number + 1]
            asked = [(step.skillset.name, one.condition) for one in step.skill.preconditions]
        names = {
            f"{of}.{atom.resource}" if of else atom.resource for of, one in asked for atom in atoms(one) if isinstance(atom, ResourceIs)
        }
        own = {f"{self.steps[number].skillset.name}.{one.resource}" for one in _assigned(self.steps[number])}
        return [(name, after.states[name]) for name in sorted(names - own) if before.states[name] != after.states[name]]


class Courses:
    """Searches courses over all skills of a robot that can end with a success."""

    def __init__(self, purposes: Purposes, using: Collection[str] = ()) -> None:
        self._purposes = purposes
        self._models = {one.skillset.name: over_approximate(one.skillset).skillset for one in purposes.known.values()}
        self._acting = [one for one in purposes.known.values() if one.achieves and (not using or one.name in using)]

    def to(self, first: Here, reaches: Callable[[Course], bool]) -> Iterator[Course]:
        """Yield courses for which ``reaches`` is true, the shortest first."""
        todo = deque([Course((), (first,))])
        seen = {first.key}
        while todo and len(seen) < MOST_SITUATIONS:
            course = todo.popleft()
            for purpose in self._acting:
                there = self.after(course.heres[-1], purpose)
                if there is None:
                    continue
                longer = Course((*course.steps, purpose), (*course.heres, there))
                if reaches(longer):
                    yield longer
                elif there.key not in seen and len(longer.steps) < MOST_STEPS:
                    seen.add(there.key)
                    todo.append(longer)

    def after(self, here: Here, purpose: Purpose) -> Here | None:
        """Return the situation after a success of a skill; None: it can't start, or a role that it needs can't be filled."""
        started = self._started(here, purpose)
        if started is None or any(not self.providers(here, role.name, purpose) for role in purpose.skill.needs):
            return None
        model, execution = self._models[purpose.skillset.name], started.running[0]
        ended = semantics.terminate(model, started, execution, purpose.skill.successes[0].name).situation
        states = {**here.states, **_named(purpose.skillset, ended.states)}
        said = list(atoms(purpose.skill.achieves)) if not isinstance(purpose.skill.achieves, (Not, Or, Implies)) else []
        states |= {f"{purpose.skillset.name}.{one.resource}": one.state for one in said if isinstance(one, ResourceIs) and not one.negated}
        for name, state in self._purposes.brought.get(purpose.name, ()):
            skillset, _, resource = name.partition(".")
            if self._models[skillset].resource(resource).has_transition(states[name], state, extern=True):
                states[name] = state
        facts = {(purpose.skillset.name, one) for one in said if isinstance(one, DataIs)}
        return Here(states, here.facts | facts)

    def may_use(self, purpose: Purpose) -> bool:
        """Return whether courses may use a skill."""
        return purpose in self._acting

    def providers(self, here: Here, role: str, needed: Purpose) -> list[Purpose]:
        """Return the skills that can fill a role for a running skill that needs it."""
        return [one for one in self._purposes.watching(role, needed) if self._started(here, one) is not None]

    def _started(self, here: Here, purpose: Purpose) -> Situation | None:
        model = self._models[purpose.skillset.name]
        local = {one.name: here.states[f"{model.name}.{one.name}"] for one in model.resources}
        step = semantics.start(model, Situation(local), Running(purpose.name, purpose.skill.name))
        runs = any(isinstance(one, Entered) and one.state is ExecutionState.RUNNING for one in step.happenings)
        return step.situation if runs and step.situation.running else None


def initial_states(skillsets: Sequence[Skillset], at_first: Collection[tuple[str, str]]) -> dict[str, str]:
    """Return the states after power-up, with those that come by themselves then."""
    states = {f"{of.name}.{one.name}": one.initial for of in skillsets for one in of.resources}
    return states | {name: state for name, state in at_first if name in states}


def _named(skillset: Skillset, states: Mapping[str, str]) -> dict[str, str]:
    return {f"{skillset.name}.{name}": state for name, state in states.items()}


def _assigned(purpose: Purpose) -> list[ResourceIs]:
    several = (purpose.skill.start, purpose.skill.successes[0].effect)
    return [ResourceIs(one.resource, one.target) for effect in several for one in effect.assignments]


_INCLUSIVE = frozenset({Comparison.LE, Comparison.GE})
_BELOW = {Comparison.LT: True, Comparison.LE: True, Comparison.GT: False, Comparison.GE: False}


def _implies(fact: DataIs, asked: DataIs) -> bool:
    """Return whether a condition of data follows from another: the same one, or on the same side of a threshold that is further away."""
    if (fact.data, fact.path) != (asked.data, asked.path):
        return False
    if (fact.comparison, fact.value, fact.unit) == (asked.comparison, asked.value, asked.unit):
        return True
    if fact.comparison not in _BELOW or asked.comparison not in _BELOW or isinstance(fact.value, str) or isinstance(asked.value, str):
        return False
    below = _BELOW[fact.comparison]
    ours, theirs = fact.value * in_si(fact), asked.value * in_si(asked)
    further = ours < theirs if below else ours > theirs
    same = ours == theirs and (asked.comparison in _INCLUSIVE or fact.comparison not in _INCLUSIVE)
    return below == _BELOW[asked.comparison] and (further or same)
