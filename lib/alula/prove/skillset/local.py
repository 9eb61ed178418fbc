"""The sixteen local checks: each looks at one block of the model alone, in any state that its resources could have.

What a check takes for granted is what the runtime has seen before: earlier preconditions for a precondition (they are
tested in order), all of them for the start, the invariants for what ends a running execution, and for an invariant's own
effect that this one is false and the others are true. Data may have any value. A check that finds a state in which
something fails gives it as a ``Suspect``: the search through the reachable situations tells whether it ever comes to that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alula.language.errors import Diagnostic, Severity
from alula.model.conditions import whatever_the_data
from alula.model.expressions import TRUE, DataIs, Expression, ResourceIs, atoms
from alula.model.model import NO_EFFECT, Effect, Event, Invariant, ResultKind, Skill, Skillset
from alula.model.span import NOWHERE, Span
from alula.prove.limits import Deadline
from alula.prove.skillset.solver import Solver

EFFECT_HINT = "a change must be a transition from the state that the resource is in, unless it is in the wanted state already"


@dataclass(frozen=True)
class Suspect:
    """A local finding whose counterexample may be out of reach; ``key`` names what fails as the search names it."""

    finding: Diagnostic
    key: tuple[str, ...]


def local_checks(skillset: Skillset, deadline: Deadline) -> tuple[list[Diagnostic], list[Suspect]]:
    """Return what is wrong in every state, and what is wrong in some state that may be out of reach."""
    checks = _Checks(skillset, deadline)
    for event in skillset.events:
        checks.event(event)
    for skill in skillset.skills:
        checks.preconditions(skill)
        checks.start(skill)
        checks.invariants(skill)
        checks.ends(skill)
    return checks.certain, checks.suspects


class _Checks:
    def __init__(self, skillset: Skillset, deadline: Deadline) -> None:
        self.skillset = skillset
        self.certain: list[Diagnostic] = []
        self.suspects: list[Suspect] = []
        self._solver = Solver(skillset, deadline)

    # --- kinds ----------------------------------------------------------------------------------------------------

    def event(self, event: Event) -> None:
        solver = self._solver
        guard, span = solver.term(event.guard), _span(event.guard, event.span)
        if not solver.possible(guard):
            self._say("ALU501", f"the guard of event `{event.name}` is never true", span, "no state of its resources fulfils it")
        elif _written(event.guard) and not solver.possible(solver.negation(guard)):
            self._say("ALU502", f"the guard of event `{event.name}` is always true", span, "leave the guard out, or make it say something")
        fails = solver.negation(solver.applies(event.effect, by_event=True))
        asked = [event.guard]
        message = f"the effect of event `{event.name}` can fail though its guard is true"
        self._suspect("ALU503", message, event.effect, span, ("event", event.name), asked, [guard, fails])

    def preconditions(self, skill: Skill) -> None:
        before: list[Any] = []
        for precondition in skill.preconditions:
            where = f"precondition `{precondition.name}` of `{skill.name}`"
            self._can_both("ALU504", "ALU505", where, precondition.condition, precondition.span, before)
            before.append(self._solver.term(precondition.condition))

    def start(self, skill: Skill) -> None:
        ready = [self._solver.term(p.condition) for p in skill.preconditions]
        fails = self._solver.negation(self._solver.applies(skill.start))
        message = f"the start effect of `{skill.name}` can fail though its preconditions are true"
        asked = [p.condition for p in skill.preconditions]
        self._suspect("ALU506", message, skill.start, skill.span, ("start", skill.name), asked, [*ready, fails])

    def invariants(self, skill: Skill) -> None:
        before: list[Any] = []
        for invariant in skill.invariants:
            where = f"invariant `{invariant.name}` of `{skill.name}`"
            self._can_both("ALU507", "ALU508", where, invariant.condition, invariant.span, before)
            self._violation(skill, invariant, where)
            if invariant.hold is None or not invariant.hold.for_s:
                self._after_start(skill, invariant, where)
            before.append(self._solver.term(invariant.condition))

    def ends(self, skill: Skill) -> None:
        """ALU511 to ALU516; what is neither a success nor a failure counts as a success."""
        interrupt = skill.interrupt
        where, span = f"the interruption of `{skill.name}`", interrupt.span if interrupt.span.line else skill.span
        self._end(skill, where, interrupt.effect, interrupt.postcondition, span, "ALU511", end_key(skill.name, ""))
        for result in skill.results:
            code = "ALU515" if skill.kind_of(result.name) is ResultKind.FAILURE else "ALU513"
            where = f"{_KIND[result.kind]} `{result.name}` of `{skill.name}`"
            self._end(skill, where, result.effect, result.postcondition, result.span, code, end_key(skill.name, result.name))

    # --- parts ----------------------------------------------------------------------------------------------------

    def _can_both(self, never: str, always: str, where: str, condition: Expression, span: Span, before: Sequence[Any]) -> None:
        """Report a condition that can't be true, or can't be false, when those before it are true."""
        term = self._solver.term(condition)
        given = " when those before it are true" if before else ""
        if not self._solver.possible(*before):
            return  # The one that made it so is reported already.
        if not self._solver.possible(*before, term):
            self._say(never, f"{where} can't succeed{given}", span, "no state fulfils it")
        elif _written(condition) and not self._solver.possible(*before, self._solver.negation(term)):
            if self._solver.possible(*before, self._solver.negation(self._solver.term(whatever_the_data(condition, unknown=False)))):
                self._warn(always, f"{where} can fail{given} only when there is no fresh value of its data", span)
            else:
                self._say(always, f"{where} can't fail{given}", span, "leave it out, or make it say something")

    def _violation(self, skill: Skill, invariant: Invariant, where: str) -> None:
        solver = self._solver
        others = [other for other in skill.invariants if other is not invariant]
        terms = [solver.negation(solver.term(invariant.condition)), *(solver.term(other.condition) for other in others)]
        terms.append(solver.negation(solver.applies(invariant.effect)))
        asked = [one.condition for one in skill.invariants]
        key = ("invariant", skill.name, invariant.name)
        self._suspect("ALU509", f"the effect of {where} can fail", invariant.effect, invariant.span, key, asked, terms)

    def _after_start(self, skill: Skill, invariant: Invariant, where: str) -> None:
        solver = self._solver
        after = {change.resource: change.target for change in skill.start.assignments}
        terms = [solver.term(p.condition) for p in skill.preconditions]
        terms += [solver.applies(skill.start), solver.negation(solver.term(invariant.recovered, after))]
        for earlier in skill.invariants[: skill.invariants.index(invariant)]:
            terms.append(solver.term(earlier.recovered, after))
        model = solver.example(*terms)
        if model is None:
            return
        conditions = [invariant.condition, *(p.condition for p in skill.preconditions)]
        resources = self._resources_of(conditions, skill.start)
        finding = Diagnostic(
            "ALU510",
            f"{where} can be false right after the start",
            invariant.span,
            hint=self._birth_hint(skill, invariant, terms[: len(skill.preconditions) + 1], after),
            example=solver.told(model, resources, _data_of(conditions)),
        )
        self.suspects.append(Suspect(finding, ("after start", skill.name, invariant.name)))

    def _birth_hint(self, skill: Skill, invariant: Invariant, started: Sequence[Any], after: Mapping[str, str]) -> str:
        """Say how to mend ALU510; where no start fulfils the invariant, a precondition does not help."""
        if self._solver.possible(*started, self._solver.term(invariant.recovered, after)):
            return f"add a precondition to `{skill.name}` that asks for it"
        return f"no start of `{skill.name}` ever fulfils it: change the invariant, or the state that the start effect leads to"

    def _end(self, skill: Skill, where: str, effect: Effect, post: Expression, span: Span, code: str, key: tuple[str, ...]) -> None:
        """Check effect and postcondition of what ends a running execution: all its invariants are true."""
        solver = self._solver
        running = [solver.term(invariant.condition) for invariant in skill.invariants]
        applies = solver.applies(effect)
        asked = [invariant.condition for invariant in skill.invariants]
        self._suspect(code, f"the effect of {where} can fail", effect, span, key, asked, [*running, solver.negation(applies)])
        after = {change.resource: change.target for change in effect.assignments}
        model = solver.example(*running, applies, solver.negation(solver.term(post, after)))
        if model is not None:
            resources = self._resources_of([post, *asked], effect)
            following = f"ALU{int(code[3:]) + 1}"
            told = solver.told(model, resources, _data_of([post, *asked]))
            hint = "it is tested after the effect; an execution that does not fulfil it has FAILED"
            finding = Diagnostic(following, f"the postcondition of {where} can fail", span, hint=hint, example=told)
            self.suspects.append(Suspect(finding, ("post", *key)))

    def _suspect(
        self,
        code: str,
        message: str,
        effect: Effect,
        span: Span,
        key: tuple[str, ...],
        asked: Sequence[Expression],
        terms: Sequence[Any],
    ) -> None:
        if effect == NO_EFFECT or not effect.assignments:
            return
        model = self._solver.example(*terms)
        if model is not None:
            told = self._solver.told(model, self._resources_of(asked, effect), _data_of(asked))
            place = effect.span if effect.span.line else span
            self.suspects.append(Suspect(Diagnostic(code, message, place, hint=EFFECT_HINT, example=told), ("effect", *key)))

    def _say(self, code: str, message: str, span: Span, hint: str) -> None:
        self.certain.append(Diagnostic(code, message, span, hint=hint))

    def _warn(self, code: str, message: str, span: Span) -> None:
        hint = "compare with a value that the data can have, or say so with a comparison that is meant to be always true"
        self.certain.append(Diagnostic(code, message, span, Severity.WARNING, hint=hint))

    def _resources_of(self, conditions: Sequence[Expression], effect: Effect) -> list[str]:
        """Return the resources that conditions and effect are about, in the model's order."""
        names = {atom.resource for condition in conditions for atom in atoms(condition) if isinstance(atom, ResourceIs)}
        names |= {change.resource for change in effect.assignments}
        return [resource.name for resource in self.skillset.resources if resource.name in names]


_KIND = {ResultKind.PLAIN: "result", ResultKind.SUCCESS: "success", ResultKind.FAILURE: "failure"}


def end_key(skill: str, result: str) -> tuple[str, ...]:
    """Return the key, for suspects and the search, of a skill's end with a result, or (``""``) by its interruption."""
    return ("result", skill, result) if result else ("interrupt", skill)


def _data_of(conditions: Sequence[Expression]) -> set[str]:
    """Return the data that conditions ask."""
    return {atom.data for condition in conditions for atom in atoms(condition) if isinstance(atom, DataIs)}


def _written(condition: Expression) -> bool:
    """Return whether a condition stands in the source: the `true` in place of one left out is no finding."""
    return condition != TRUE or condition.span != NOWHERE


def _span(condition: Expression, otherwise: Span) -> Span:
    return condition.span if condition.span.line else otherwise


def keys(skillset: Skillset) -> Iterator[tuple[str, ...]]:
    """Yield the key of every effect that is not empty, as in suspects and the search."""
    for event in skillset.events:
        if event.effect.assignments:
            yield ("effect", "event", event.name)
    for skill in skillset.skills:
        parts: list[tuple[tuple[str, ...], Effect]] = [
            (("start", skill.name), skill.start),
            (end_key(skill.name, ""), skill.interrupt.effect),
        ]
        parts += [(("invariant", skill.name, one.name), one.effect) for one in skill.invariants]
        parts += [(end_key(skill.name, result.name), result.effect) for result in skill.results]
        for key, effect in parts:
            if effect.assignments:
                yield ("effect", *key)
