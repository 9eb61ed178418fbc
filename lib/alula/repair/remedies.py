"""Branches made of courses of skills: to make it possible that a skill runs again, or to reach the place that a mission calls safe."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

from alula.missions.skill_types import OUTCOME_PORT
from alula.model.expressions import And
from alula.repair.branches import FALLBACKS, HOLE, Branch, Rank, node
from alula.repair.composing import Composer, Sources, opening
from alula.repair.courses import Course, Courses, Here, States, initial_states
from alula.repair.failing import Failing
from alula.repair.naming import another, chances, listed, plain, told_resource, told_state
from alula.repair.purposes import Purpose, Purposes, asked_of_others
from alula.repair.subject import Subject
from alula.trees.attributes import node_name, type_name
from alula.trees.document import Element
from alula.trees.node import Node, pointer

AGAIN_S = "1"
"""How long after a failure a node gets its other chance, seconds."""
SAFE = "safe"
"""A mission's input that has this word in its name is a place where the robot may be left."""
MOST_COURSES = 3
LOOP = "Until"
"""A node that ticks its child again when that has succeeded, unless it is through."""


class Remedies:
    """Makes branches of courses from the situation of a failure."""

    def __init__(self, subject: Subject, purposes: Purposes, sources: Sources, courses: Courses, attempts: int) -> None:
        self._subject = subject
        self._purposes = purposes
        self._sources = sources
        self._courses = courses
        self._composer = Composer(sources, courses)
        self._attempts = attempts
        self.lacking: dict[str, list[str]] = {}
        """The skills that would bring about what a failed one needs, each with its inputs that come from nowhere."""

    def around(self, place: Node, failing: Failing, states: States) -> Iterator[Branch]:
        """Yield skills that make true what the failed one needs, before the next round of a loop, or before a retry of the node."""
        purpose = self._purposes.known[failing.skill]
        skill = purpose.skill
        several = [*(one.condition for one in skill.preconditions), *(one.condition for one in skill.invariants)]
        if not several:
            return
        wanted = (purpose.skillset.name, several[0] if len(several) == 1 else And(tuple(several)))
        here = Here(self._at_rest(states))
        if here.fulfils(wanted):
            return
        courses = list(islice(self._courses.to(here, lambda one: one.heres[-1].fulfils(wanted)), MOST_COURSES))
        for course in (one for one in courses if failing.skill not in {step.name for step in one.steps}):
            for reused in self._reused(course, failing):
                steps = self._composer.after_one_another(course, {len(course.steps): wanted}, reused=reused)
                if steps and _begins_again(place):
                    yield self._before_the_next_round(place, failing, course, steps)
                if steps:
                    yield self._again_after(place, failing, course, steps)
                else:
                    self.lacking |= {one.name: lacking for one in course.steps if (lacking := self._sources.lacking(one))}

    def at_the_safe_place(self, place: Node, failing: Failing, states: States) -> Iterator[Branch]:
        """Yield ways to the place that the mission calls safe, by each skill that can replace one of its own."""
        safe = next((one for one in self._sources.ports if SAFE in one.split("_")), None)
        if safe is None or not failing.states:
            return
        trees = self._subject.files.trees.values()
        used = {type_name(one) for tree in trees for one in tree.iterate()} & set(self._purposes.known)
        roles = {role for name in used for role in self._purposes.known[name].roles}
        here = Here(self._at_rest(states))
        robot = self._purposes.known[failing.skill].robot
        for purpose in self._purposes.known.values():
            if (
                purpose.robot == robot
                and self._courses.may_use(purpose)
                and purpose.roles & roles
                and len(purpose.inputs) == 1
                and self._courses.after(here, purpose) is not None
            ):
                (given,) = purpose.inputs
                step = self._composer.step(purpose, here, {given: f"{{{safe}}}"})
                if step is not None:
                    code, name = "@degraded := true; @stopping := true", f"{plain(purpose.name)} to safety"
                    yield self._end(place, failing, purpose, step, name, code, Rank.ENDS_WELL)

    def other_ways(self, place: Node, failing: Failing, states: States) -> Iterator[Branch]:
        """Yield parts with a skill replaced by another of its role, with what that one needs beside it."""
        here = Here(self._at_rest(states))
        acting = [one for one in place.config.element.iterate() if type_name(one) in self._purposes.known]
        several = [one for one in acting if self._purposes.known[type_name(one)].achieves]
        if len(several) != 1 or not failing.states or not any(type_name(one) == failing.skill for one in acting):
            return
        (leaf,) = several
        for purpose in self._purposes.stand_ins(type_name(leaf)):
            if self._courses.may_use(purpose) and self._courses.after(here, purpose) is not None:
                step = self._composer.step(purpose, here, {name: leaf.get(name) for name in purpose.inputs})
                if step is not None:
                    yield self._end(place, failing, purpose, step, f"{plain(purpose.name)} instead", "@degraded := true", Rank.GOES_ON)

    def without(self, place: Node, failing: Failing) -> Iterator[Branch]:
        """Yield the mission without a part whose role a later step fills all the same, with skillsets that the part does not use.

        So one robot of two gives up its task, and the other one goes there.
        """
        above = place.parent
        if above is None or above.config.element.tag != "Sequence":
            return
        mine = self._in(place)
        roles = {role for one in mine if one.achieves for role in one.roles}
        skillsets = {one.skillset.name for one in mine}
        later = [one for other in above.children[above.children.index(place) + 1 :] for one in self._in(other)]
        instead = [one for one in later if one.achieves and one.roles & roles and one.skillset.name not in skillsets]
        if instead:
            (first, *_), name = instead, node_name(place.config.element)
            role = listed(told_resource(one) for one in sorted(first.roles & roles))
            why = f"{failing.situation}: go on without '{name}'; {first.name} comes later, for the same {role}."
            script = node("Script", name=f"not done: {name}", code="@degraded := true")
            yield Branch(script, None, place.config.element.place, (why,), rank=Rank.LEAVES_OUT)

    # --- parts -------------------------------------------------------------------------------------------------------

    def _in(self, place: Node) -> list[Purpose]:
        """Return the skills of a part of the mission, with those of the trees that it uses."""
        names = dict.fromkeys(type_name(one.config.element) for one in place.iterate())
        return [self._purposes.known[name] for name in names if name in self._purposes.known]

    def _at_rest(self, states: States) -> dict[str, str]:
        """Return the states of all resources once the skills that ran have given theirs back: what their starts take is as at first."""
        found = initial_states(self._subject.skillsets, self._subject.at_first)
        taken = {(f"{one.skillset.name}.{name}", state) for one in self._purposes.known.values() for name, state in one.holds.items()}
        return found | {name: state for name, state in states.items() if (name, state) not in taken}

    def _reused(self, course: Course, failing: Failing) -> Iterator[Mapping[str, Element]]:
        """Yield which trees of the files stand for skills of a course: each that has one of them and no other part in it, then none."""
        steps = {one.name for one in course.steps}
        for name, tree in self._subject.files.trees.items():
            skills = [type_name(one) for one in tree.iterate() if type_name(one) in self._purposes.known]
            mine = [one for one in skills if one in steps]
            if len(mine) == 1 and len(set(skills)) <= 2 and failing.skill not in skills:
                yield {mine[0]: node("SubTree", ID=name, name=plain(name), _autoremap="true")}
        yield {}

    def _before_the_next_round(self, place: Node, failing: Failing, course: Course, steps: list[Element]) -> Branch:
        """Return the course as another child of a Fallback that a loop ticks again when it has succeeded."""
        condition, name, after = "", "", list[Element]()
        entry = pointer(failing.leaf.config.element.get(OUTCOME_PORT), OUTCOME_PORT)
        if entry and failing.results:
            condition = " || ".join(f"{entry} == '{one}'" for one in failing.results)
            name = f"{plain(failing.skill)} has failed"
            after = [node("Script", name="it may go on", code=f"{entry} := ''")]
        words = f"{plain(course.steps[-1].name)} and go on"
        *asked, degraded = opening(condition, name, "@degraded := true")
        top = node("Sequence", *asked, *steps, degraded, *after, name=words)
        use = node("SubTree", ID=self._tree(words), name=words, _autoremap="true")
        return Branch(use, top, place.config.element.place, _why(failing, course, steps, "then on with the work"))

    def _again_after(self, place: Node, failing: Failing, course: Course, steps: list[Element]) -> Branch:
        """Return a retry around the node and the course, which is done after each failure."""
        element = place.config.element
        last = course.steps[-1]
        words = plain(last.name)
        top = node("Sequence", *steps, *opening("", "", "@degraded := true"), name=words)
        use = node("SubTree", ID=self._tree(words), name=words, _autoremap="true")
        name = f"{node_name(element)}, or {words} first"
        fallback = node("Fallback", node(HOLE, name=node_name(element)), node("ForceFailure", use, name="then again"), name=name)
        needed = _needed(last)
        again = chances(self._attempts, node_name(element) if place is failing.leaf else "")
        if needed:
            retry = node("RetryAfter", fallback, name=again, attempts=str(self._attempts), wait=AGAIN_S, if_=needed)
        else:
            retry = node("RetryUntilSuccessful", fallback, name=again, num_attempts=str(self._attempts))
        return Branch(retry, top, element.place, _why(failing, course, steps, "then it gets another chance"), around=True)

    def _tree(self, words: str) -> str:
        return another("_".join(words.split()), self._subject.files.trees)

    def _end(self, place: Node, failing: Failing, purpose: Purpose, step: Element, name: str, code: str, rank: Rank) -> Branch:
        """Return a step as a branch that is for the failed one alone: where what shows the fault is not there, it fails."""
        shown = " || ".join(f"{at} == {state}" for at, state in failing.states)
        told = " or ".join(told_state(at, state) for at, state in failing.states)
        top = node("Sequence", *opening(shown, told, code), step, name=name)
        ends = "" if rank is Rank.GOES_ON else " to the safe place, and end there, degraded"
        why = (f"{failing.situation}: {plain(purpose.name)}{ends}.", *_beside([purpose], [step]))
        use = node("SubTree", ID=self._tree(name), name=name, _autoremap="true")
        return Branch(use, top, place.config.element.place, why, rank=rank)


def _needed(purpose: Purpose) -> str:
    return " && ".join(f"{purpose.skillset.name}.{resource.name} == {state}" for resource, state in asked_of_others(purpose))


def _begins_again(place: Node) -> bool:
    """Return whether a node is in a Fallback that is ticked again when another of its children succeeds."""
    outer = place.parent
    loop = None if outer is None else outer.parent
    return outer is not None and loop is not None and outer.config.element.tag in FALLBACKS and loop.config.element.tag == LOOP


def _why(failing: Failing, course: Course, steps: Sequence[Element], then: str) -> tuple[str, ...]:
    names = ", ".join(plain(one.name) for one in course.steps)
    return (f"{failing.situation}: {names}, {then}.", *_beside(course.steps, steps))


def _beside(needing: Sequence[Purpose], steps: Sequence[Element]) -> list[str]:
    """Return why skills run beside others: ``scan gives the dock its sight``."""
    beside = {node_name(one) for step in steps for part in step.iterate() if part.tag == "Parallel" for one in part.children[:-1]}
    for_skills = listed(dict.fromkeys(plain(one.name) for one in needing if one.skill.needs)) if beside else ""
    roles = listed(dict.fromkeys(told_resource(role.name) for one in needing for role in one.skill.needs)) if beside else ""
    return [f"'{listed(sorted(beside))}' is the {roles} that {for_skills} needs."] if beside else []
