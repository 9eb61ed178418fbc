"""A robot's models as PDDL: skills are actions, states of resources are propositions, roles are what has to be filled.

Three notations, each with what it can say:

- *classical*: a skill that succeeds is an action with the effects of its success; one that runs beside others has an action that starts it
  and one that ends it. Invariants, durations and other results are not said.
- *temporal* (PDDL 2.1): a skill is a durative action; its invariants, and the roles that it needs, hold over all of it.
- *results* (FOND): as classical, with one effect for each result of the skill; which one comes is the world's choice.

What no notation says is left out, and told (`Models.left_out`): conditions of data, what breaks an invariant, the effect of that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from alula.model.expressions import And, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs
from alula.model.model import Effect, Skill, Skillset
from alula.repair.courses import Fact, Here
from alula.repair.purposes import Purpose, Purposes

CLASSICAL, TEMPORAL, RESULTS = "classical", "temporal", "results"
REQUIREMENTS = {
    CLASSICAL: ":strips :negative-preconditions :disjunctive-preconditions",
    TEMPORAL: ":strips :negative-preconditions :disjunctive-preconditions :durative-actions :duration-inequalities",
    RESULTS: ":strips :negative-preconditions :disjunctive-preconditions :non-deterministic",
}
RUNS_S = 10
"""How long a skill that succeeds takes, of which models say nothing, seconds."""
NOTHING = "nothing"
"""What a result brings about that changes nothing: parsers take no empty effect."""
LONGEST_S = 1000
"""How long one may run that is there to run, seconds."""


@dataclass(frozen=True)
class Text:
    """A domain and a problem."""

    domain: str
    problem: str


@dataclass
class Models:
    """The models of a robot, to be written as PDDL.

    Attributes:
        purposes: what its skills are for.
        left_out: what was not said, each with its place.
    """

    purposes: Purposes
    left_out: set[str] = field(default_factory=set)

    def text(self, notation: str, here: Here, goal: str | Expression) -> Text:
        """Return them in a notation, from a situation to a goal: a role that a skill's success fills, or a condition."""
        skills = self.purposes.known.values()
        changing = [one for one in skills if not one.achieves or self._after(one, one.skill.successes[0].name)]
        actions = "\n".join(text for one in changing for text in self._actions(one, notation))
        predicates = " ".join(f"({one})" for one in sorted(self._predicates()))
        requirements = REQUIREMENTS[notation]
        domain = f"(define (domain robot)\n(:requirements {requirements})\n(:predicates {predicates})\n{actions}\n)\n"
        true = [f"({_state(*name.partition('.')[::2], state)})" for name, state in sorted(here.states.items())]
        true += [f"({_fact(fact)})" for fact in sorted(here.facts, key=str)]
        wanted = f"({_done(goal)})" if isinstance(goal, str) else self._condition(goal, None, "the goal")
        problem = f"(define (problem case)\n(:domain robot)\n(:init {' '.join(true)})\n(:goal {wanted})\n)\n"
        return Text(domain, problem)

    # --- actions -----------------------------------------------------------------------------------------------------

    def _actions(self, one: Purpose, notation: str) -> Iterable[str]:
        if notation == TEMPORAL:
            return [self._durative(one)]
        if not one.achieves:
            return self._started_and_ended(one)
        asked = _all([*self._asked(one), *_needed(one.skill)])
        if notation == CLASSICAL:
            return [_action(_name(one), asked, _all(self._after(one, one.skill.successes[0].name)))]
        several = [_all(self._after(one, result.name) or [f"({NOTHING})"]) for result in one.skill.results]
        return [_action(_name(one), asked, several[0] if len(several) == 1 else f"(oneof {' '.join(several)})")]

    def _started_and_ended(self, one: Purpose) -> list[str]:
        running, fills = f"running-{_name(one)}", [f"(filled-{role})" for role in sorted(one.roles)]
        begun = [*self._set(one.skillset, one.skill.start), f"({running})", *fills]
        ended = [*self._set(one.skillset, one.skill.interrupt.effect), f"(not ({running}))", *(f"(not {fill})" for fill in fills)]
        asked = _all([*self._asked(one), *_needed(one.skill)])
        return [_action(f"start-{_name(one)}", asked, _all(begun)), _action(f"end-{_name(one)}", f"({running})", _all(ended))]

    def _durative(self, one: Purpose) -> str:
        place = f"{one.name}, invariant"
        held = [*(self._condition(each.condition, one.skillset, place) for each in one.skill.invariants), *_needed(one.skill)]
        conditions = [f"(at start {each})" for each in self._asked(one)] + [f"(over all {each})" for each in held if each]
        effects = [f"(at start {each})" for each in self._set(one.skillset, one.skill.start)]
        if one.achieves:
            effects += [f"(at end {each})" for each in self._after(one, one.skill.successes[0].name, started=False)]
            duration = f"(= ?duration {RUNS_S})"
        else:
            fills = [f"(filled-{role})" for role in sorted(one.roles)]
            effects += [f"(at start {each})" for each in fills]
            effects += [f"(at end {each})" for each in self._set(one.skillset, one.skill.interrupt.effect)]
            effects += [f"(at end (not {each}))" for each in fills]
            duration = f"(and (>= ?duration 1) (<= ?duration {LONGEST_S}))"
        parts = f":parameters ()\n :duration {duration}\n :condition {_all(conditions)}\n :effect {_all(effects)}"
        return f"(:durative-action {_name(one)}\n {parts})"

    def _asked(self, one: Purpose) -> list[str]:
        conditions = (self._condition(each.condition, one.skillset, f"{one.name}, precondition") for each in one.skill.preconditions)
        return [each for each in conditions if each]

    def _after(self, one: Purpose, result: str, *, started: bool = True) -> list[str]:
        """Return what a result brings about, after what the start has; of a success also what it achieves, as models and mocks say it."""
        changes = {each.resource: each.target for each in one.skill.start.assignments} if started else {}
        changes |= {each.resource: each.target for each in one.skill.result(result).effect.assignments}
        success = result == one.skill.successes[0].name
        several = [text for name, state in changes.items() for text in _becomes(one.skillset, name, state)]
        if not success:
            return several
        for name, state in self.purposes.brought.get(one.name, ()):
            skillset, _, resource = name.partition(".")
            several += _becomes(next(of.skillset for of in self.purposes.known.values() if of.skillset.name == skillset), resource, state)
        said = one.skill.achieves
        for each in said.operands if isinstance(said, And) else (said,):
            if isinstance(each, ResourceIs) and not each.negated:
                several += _becomes(one.skillset, each.resource, each.state)
            elif isinstance(each, DataIs):
                several.append(f"({_fact((one.skillset.name, each))})")
        return list(dict.fromkeys([*several, *(f"({_done(role)})" for role in sorted(one.roles))]))

    @staticmethod
    def _set(skillset: Skillset, effect: Effect) -> list[str]:
        return [text for each in effect.assignments for text in _becomes(skillset, each.resource, each.target)]

    # --- conditions --------------------------------------------------------------------------------------------------

    def _condition(self, condition: Expression, skillset: Skillset | None, place: str) -> str:
        """Return a condition; empty where PDDL does not say it, or it is always true."""
        match condition:
            case ResourceIs(resource=name, state=state, negated=negated):
                of, resource = (skillset.name, name) if skillset is not None else name.split(".")
                return f"(not ({_state(of, resource, state)}))" if negated else f"({_state(of, resource, state)})"
            case And(operands=several):
                return _all([text for each in several if (text := self._condition(each, skillset, place))])
            case Or(operands=several):
                parts = [self._condition(each, skillset, place) for each in several]
                return f"(or {' '.join(parts)})" if all(parts) else ""
            case Not(operand=operand):
                text = self._condition(operand, skillset, place)
                return f"(not {text})" if text else ""
            case Implies(premise=premise, conclusion=conclusion):
                return self._condition(Or((Not(premise), conclusion)), skillset, place)
            case Constant(value=True):
                return ""
            case _:
                self.left_out.add(f"data of {place}")
                return ""

    def _predicates(self) -> set[str]:
        known = self.purposes.known.values()
        skillsets = {one.skillset.name: one.skillset for one in known}.values()
        states = {_state(of.name, each.name, state) for of in skillsets for each in of.resources for state in each.states}
        running = {f"running-{_name(one)}" for one in known if not one.achieves}
        roles = {role for one in known for role in one.roles} | {each.name for one in known for each in one.skill.needs}
        facts = {
            _fact((one.skillset.name, each))
            for one in known
            for each in (one.skill.achieves.operands if isinstance(one.skill.achieves, And) else (one.skill.achieves,))
            if isinstance(each, DataIs)
        }
        return {NOTHING} | states | running | facts | {f"filled-{role}" for role in roles} | {_done(role) for role in roles}


# --- names --------------------------------------------------------------------------------------------------------------


def _name(one: Purpose) -> str:
    return one.name.replace(".", "-").replace("_", "-").lower()


def names(purposes: Purposes) -> Mapping[str, str]:
    """Return the skills by the names of their actions, also of those that start and end them."""
    known = {_name(one): one.name for one in purposes.known.values()}
    return known | {f"{what}-{name}": skill for name, skill in known.items() for what in ("start", "end")}


def _state(skillset: str, resource: str, state: str) -> str:
    return f"{skillset}-{resource}-{state}".replace("_", "-").lower()


def _fact(fact: Fact) -> str:
    skillset, one = fact
    words = "-".join([skillset, one.data, *one.path, one.comparison.name, str(one.value)])
    return "".join(sign if sign.isalnum() else "-" for sign in words).lower()


def _done(role: str) -> str:
    return f"done-{role}"


def _needed(skill: Skill) -> list[str]:
    return [f"(filled-{one.name})" for one in skill.needs]


def _becomes(skillset: Skillset, resource: str, state: str) -> list[str]:
    others = [one for one in skillset.resource(resource).states if one != state]
    return [f"({_state(skillset.name, resource, state)})", *(f"(not ({_state(skillset.name, resource, one)}))" for one in others)]


def _all(several: Sequence[str]) -> str:
    return several[0] if len(several) == 1 else f"(and {' '.join(several)})"


def _action(name: str, condition: str, effect: str) -> str:
    return f"(:action {name}\n :parameters ()\n :precondition {condition}\n :effect {effect})"
