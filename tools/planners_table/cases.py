"""What planners are asked for, of the rover of this repository, and what may go otherwise on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import And, ResourceIs
from alula.repair.courses import Courses, Here, initial_states
from alula.repair.purposes import Purpose, Purposes
from alula.repair.repairing import condition_of
from alula.repair.subject import Subject


@dataclass(frozen=True)
class Case:
    """A goal, as `alula plan` takes it, and the states that are not those after power-up."""

    goal: str
    start: str


CASES = {
    "dock": Case("base.base_status == DOCKED", "base.base_status == AWAY and base.pose_status == LOST and base.link == UP"),
    "laser": Case("arrival", "base.base_status == AWAY and base.pose_status == GOOD and base.link == UP and perception.laser == BROKEN"),
}


@dataclass(frozen=True)
class Otherwise:
    """What may happen in the place of a success: another result, or a state that breaks what has to hold; and what is so then."""

    what: str
    is_result: bool
    here: Here


def beginning(case: Case, subject: Subject) -> Here:
    """Return the situation in which a case begins."""
    condition = condition_of("--from", case.start)
    several = condition.operands if isinstance(condition, And) else (condition,)
    states = initial_states(subject.skillsets, subject.at_first)
    return Here(states | {one.resource: one.state for one in several if isinstance(one, ResourceIs)})


def otherwise(steps: Sequence[str], here: Here, purposes: Purposes) -> Iterator[Otherwise]:
    """Yield what may happen in each step of a plan that succeeds but for that: it is at rest again then."""
    courses = Courses(purposes)
    for name in steps:
        purpose = purposes.known[name]
        if not purpose.achieves:
            continue
        for result in purpose.skill.results:
            if result.name not in purpose.achieves:
                yield Otherwise(f"{name} ends {result.name}", is_result=True, here=here)
        beside = [one for role in purpose.skill.needs for one in courses.providers(here, role.name, purpose)[:1]]
        for one in (purpose, *beside):
            yield from _broken(name, one, here)
        after = courses.after(here, purpose)
        if after is None:
            return
        here = after


def _broken(step: str, one: Purpose, here: Here) -> Iterator[Otherwise]:
    for resource in one.skillset.resources:
        at = f"{one.skillset.name}.{resource.name}"
        for moved in resource.transitions:
            states = {resource.name: moved.target}
            broken = any(judge(each.condition, states, NO_DATA) is False for each in one.skill.invariants)
            if moved.extern and moved.source == here.states[at] and broken:
                found = replace(here, states={**here.states, at: moved.target})
                yield Otherwise(f"{at} {moved.target} in {step}", is_result=False, here=found)
