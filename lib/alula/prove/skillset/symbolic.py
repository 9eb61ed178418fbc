"""The search with sets of situations, for skillsets with more than can be looked at one by one."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from alula.language.counterexamples import Counterexample
from alula.language.errors import Diagnostic, Severity
from alula.model.expressions import Constant
from alula.model.model import Property, PropertyKind, Skill, Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.skillset import counterexample, reachable
from alula.prove.skillset.abstract import Abstraction
from alula.prove.skillset.diagrams import Encoded
from alula.prove.skillset.encoding import encode
from alula.prove.skillset.local import Suspect
from alula.prove.skillset.properties import failed, lasso, true_in
from alula.prove.skillset.sets import Sets
from alula.prove.skillset.steps import Key, TransitionSystem
from alula.prove.skillset.walk import MOST_IN_A_LOOP, Walker


def search(
    skillset: Skillset, abstraction: Abstraction, suspects: Iterable[Suspect], deadline: Deadline, *, copies: int
) -> list[Diagnostic]:
    """Return all global findings; raise OutOfTimeError.

    Where not even half of the time is enough with a bound of what can be reached, the rest goes into finding exactly that.
    """
    found = _Search(skillset, abstraction, deadline, copies)
    if not found.sets.exact:
        found.sets.until(deadline.half("situations as sets, within a bound of what can be reached"))
        try:
            return found.findings(list(suspects))
        except OutOfTimeError:
            found.sets.until(deadline)
            found.sets.complete()
    return found.findings(list(suspects))


class _Search:
    def __init__(self, skillset: Skillset, abstraction: Abstraction, deadline: Deadline, copies: int) -> None:
        self.skillset = skillset
        self.copies = copies
        self.system = TransitionSystem(abstraction, copies=copies)
        self.model: Encoded = encode(abstraction, copies, deadline)
        self.sets = Sets(self.model, deadline)
        self.walker = Walker(self.system, self.sets)

    def findings(self, suspects: list[Suspect]) -> list[Diagnostic]:
        """Return the findings of all checks."""
        findings = reachable.judged(self.skillset, suspects, self._counterexamples({suspect.key for suspect in suspects}))
        findings += reachable.unreachable_states(self.skillset, [set(self._seen(r.name)) for r in self.skillset.resources])
        findings += [reachable.dead_skill(skill) for skill in self.skillset.skills if self._dead(skill)]
        findings += self._held_twice()
        findings += self._lost()
        findings += reachable.crowded(self.skillset, self._crowded(), self.copies)
        for wanted in self.skillset.properties:
            found = self._property(wanted)
            findings += [found] if found else []
        return findings

    # --- faults ---------------------------------------------------------------------------------------------------

    def _counterexamples(self, suspected: set[Key]) -> dict[Key, Counterexample]:
        """Return the counterexample of each fault that is reached: of effects, and of what else is suspected."""
        counterexamples: dict[Key, Counterexample] = {}
        for fault, goal in self._shown():
            if fault[0] != "effect" and fault not in suspected:
                continue
            moves = self.walker.fault(fault, goal)
            if moves is not None:
                counterexamples[fault] = counterexample.walked(self.system, self.system.initial(), moves, fault)
        return counterexamples

    def _shown(self) -> Iterator[tuple[Key, Any]]:
        """Yield each fault that is reached with the situations before its step."""
        for fault, where in self.model.faults.items():
            if self._reaches(where):
                yield fault, where
        for fault, within in self.model.inner.items():
            if within.situations & self.sets.bound.within(within.about) == self.sets.bdd.false:
                continue
            before = self.sets.before(self.sets.bdd.false, within=within)
            if self._reaches(before):
                yield fault, before

    # --- what can be reached --------------------------------------------------------------------------------------

    def _reaches(self, goal: Any) -> bool:
        return self.walker.reaches(goal)

    def _seen(self, resource: str) -> Iterator[str]:
        return (state for state in self.skillset.resource(resource).states if self._reaches(self.model.is_state(resource, state)))

    def _dead(self, skill: Skill) -> bool:
        asked_in_vain = self.model.faults["effect", "start", skill.name]
        return not self._reaches(self.model.startable[skill.name]) and not self._reaches(asked_in_vain)

    def _crowded(self) -> set[str]:
        changing = {s.name for s in self.skillset.skills if s.name not in self.system.idle}
        return {name for name in changing if self._reaches(self.model.crowded[name])}

    def _held_twice(self) -> list[Diagnostic]:
        findings: list[Diagnostic] = []
        taken: dict[tuple[str, str], list[str]] = {}
        for skill in self.skillset.skills:
            for resource, state in reachable.takes(skill).items():
                taken.setdefault((resource, state), []).append(skill.name)
        for (resource, state), names in taken.items():
            here = self.model.is_state(resource, state)
            for first, second in itertools.combinations_with_replacement(names, 2):
                both = here & (self.model.runs(first, 2) if first == second else self.model.runs(first) & self.model.runs(second))
                moves = self.walker.to(both)
                if moves is not None:
                    run = counterexample.walked(self.system, self.system.initial(), moves)
                    findings.append(reachable.held_twice(self.skillset, resource, state, (first, second), run))
        return findings

    def _lost(self) -> list[Diagnostic]:
        """Return skills that can be lost; where all can go back to the beginning, what starts at all can start again."""
        if self.sets.narrowed(self.sets.reached & ~self.sets.can_come_to(self.sets.initial)) == self.sets.bdd.false:
            return []
        groups: dict[Counterexample, list[str]] = {}
        for skill in self.skillset.skills:
            starts = self.model.startable[skill.name]
            if not self._reaches(starts):
                continue
            moves = self.walker.to(self.sets.reached & ~self.sets.can_come_to(starts))
            if moves is not None:
                groups.setdefault(counterexample.walked(self.system, self.system.initial(), moves), []).append(skill.name)
        return [reachable.lost(self.skillset, names, run) for run, names in groups.items()]

    # --- properties -----------------------------------------------------------------------------------------------

    def _property(self, wanted: Property) -> Diagnostic | None:
        condition = self.model.term(wanted.condition)
        match wanted.kind:
            case PropertyKind.NEVER:
                return self._single(wanted, condition)
            case PropertyKind.ALWAYS:
                return self._single(wanted, ~condition)
            case PropertyKind.EVENTUALLY:
                return self._run(wanted, self.sets.initial, condition)
            case PropertyKind.LEADS_TO:
                return self._run(wanted, condition, self.model.term(wanted.consequence or Constant(value=False)))

    def _single(self, wanted: Property, bad: Any) -> Diagnostic | None:
        if not self._reaches(bad):
            return None
        moves = self.walker.to(bad)
        if moves is None:
            return _unsure(wanted)
        run = counterexample.walked(self.system, self.system.initial(), moves)
        return failed(wanted, counterexample.situation(self.system, self.walker.end(moves)), run)

    def _run(self, wanted: Property, begins: Any, goal: Any) -> Diagnostic | None:
        """Look for a run that avoids the goal for ever; a set that allows one is walked before it is believed."""
        leads = wanted.kind is PropertyKind.LEADS_TO and wanted.fair
        if leads and not self.sets.exact and self._kept_by_few(begins, goal):
            return None
        avoiding = self._for_ever(goal, [skill.name for skill in self.skillset.skills] if wanted.fair else [])
        if not self._reaches(begins & avoiding):
            return None
        condition = wanted.condition if wanted.kind is PropertyKind.EVENTUALLY else wanted.consequence or Constant(value=False)
        suspected = begins & avoiding
        while self._reaches(suspected):
            moves = self.walker.to(suspected)
            if moves is None:
                return _unsure(wanted)
            graph, looked = self.walker.graph(moves, avoiding)
            closed = [n not in looked or true_in(self.system, condition, state) for n, state in enumerate(graph.states)]
            refuted = lasso(graph, wanted, [len(moves)], closed)
            if refuted is not None or len(looked) >= MOST_IN_A_LOOP:
                return refuted or _unsure(wanted)
            # All that can follow was looked at: what led here are steps that come back to where they began.
            suspected &= ~self.sets.only(graph.states[number] for number in looked)
        return None

    def _kept_by_few(self, begins: Any, goal: Any) -> bool:
        """Return whether a property holds even if only the skills around it have to end, in all that their bound allows.

        Fewer skills that have to end, and more situations, allow more runs: where none of these is against the property, none is.
        """
        around = self.sets.bound.around(begins, goal)
        skills = sorted(self.sets.bound.skills(around))
        avoiding, before = around & ~goal, self.sets.bdd.false
        while avoiding != before:
            before = avoiding
            avoiding = self._ending(avoiding, skills)
        return not self._reaches(begins & avoiding)

    def _for_ever(self, goal: Any, ending: Sequence[str]) -> Any:
        """Return all from which a run may avoid the goal for ever (Emerson and Lei's greatest fixpoint), or more.

        No execution of the skills ``ending`` lasts for ever.
        """
        sets = self.sets
        stuck = sets.reached & ~sets.staying(sets.reached)
        avoiding, before = sets.reached & ~goal, sets.bdd.false
        while avoiding != before:
            before = avoiding
            avoiding = self._ending(sets.staying(avoiding) | (avoiding & stuck), ending)
        return avoiding

    def _ending(self, avoiding: Any, skills: Iterable[str]) -> Any:
        """Return what a run can begin with that stays in a set and comes, for each of these skills, to where it ends or rests."""
        for skill in skills:
            rests = ~self.model.runs(skill)
            if avoiding & ~rests != self.sets.bdd.false:
                good = avoiding & (rests | self.sets.before(avoiding, ending=skill))
                avoiding = self.sets.can_come_to(good, inside=avoiding)
        return avoiding


def _unsure(wanted: Property) -> Diagnostic:
    message = f"property `{wanted.name}` was neither proved nor refuted: a run against it may exist, but none was found"
    return Diagnostic("ALU540", message, wanted.span, Severity.ERROR)
