"""What time decides: invariants that may be false for a while, values that must recover, progress that must not stand still.

The rules are in skillsets/LANGUAGE.md, under Quantities. What they remember is in the situation: ``fallen`` belongs to the skillset,
whichever skills run; ``false_since`` and ``progressed`` belong to an execution and go with it. A condition counts as false, or not,
at the end of each step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from alula.model.conditions import judge
from alula.model.expressions import DataIs
from alula.model.model import Invariant, Skill, Skillset
from alula.model.situation import Running, Situation

NS_PER_S = 1_000_000_000


def nanoseconds(seconds: float) -> int:
    """Return seconds as whole nanoseconds, rounded to the nearest."""
    return round(seconds * NS_PER_S)


def waits(invariant: Invariant) -> bool:
    """Return whether the invariant may be false for a while."""
    return invariant.hold is not None and invariant.hold.for_s > 0


def good(skill: Skill, invariant: Invariant, situation: Situation) -> bool:
    """Return whether an invariant counts as true now: its condition is, by values that need not recover first."""
    if (skill.name, invariant.name) in situation.fallen:
        return False
    return judge(invariant.condition, situation.states, situation.data) is True


def watch(skillset: Skillset, situation: Situation, before: Situation) -> Situation:
    """Return the situation at the end of a step with what waits, each since the time that it has in ``before`` or since now."""
    false_since = {
        (execution, invariant.name): before.false_since.get((execution, invariant.name), situation.now_ns)
        for execution in situation.running
        for skill in [skillset.skill(execution.skill)]
        for invariant in skill.invariants
        if waits(invariant) and not good(skill, invariant, situation)
    }
    return replace(situation, false_since=false_since) if false_since or situation.false_since else situation


def with_value(skillset: Skillset, situation: Situation, name: str, value: object | None) -> Situation:
    """Return the situation with a fresh value of a data, or without one; remember what has fallen, forget what has recovered."""
    data = {key: kept for key, kept in situation.data.items() if key != name}
    if value is None:
        return replace(situation, data=data)
    data[name] = value
    fallen = set(situation.fallen)
    for skill, invariant in _recovering(skillset, name):
        key = (skill.name, invariant.name)
        if judge(invariant.condition, situation.states, data) is False:
            fallen.add(key)
        elif judge(invariant.recovered, situation.states, data) is True:
            fallen.discard(key)
    return replace(situation, data=data, fallen=frozenset(fallen))


def _recovering(skillset: Skillset, data: str) -> Iterator[tuple[Skill, Invariant]]:
    """Yield the invariants over this data that have a recovery value."""
    for skill in skillset.skills:
        for invariant in skill.invariants:
            condition, hold = invariant.condition, invariant.hold
            if hold is not None and hold.hysteresis is not None and isinstance(condition, DataIs) and condition.data == data:
                yield skill, invariant


# --- what becomes due -------------------------------------------------------------------------------------------------


def due_ns(skillset: Skillset, situation: Situation) -> int | None:
    """Return when time alone next breaks an invariant or a progress deadline, or None; it may be in the past."""
    if not (situation.false_since or situation.progressed):
        return None  # which is asked for before every step
    return min((*_durations(skillset, situation), *_deadlines(skillset, situation)), default=None)


def is_due(execution: Running, invariant: Invariant, situation: Situation) -> bool:
    """Return whether an invariant that is not good has been so for as long as it may."""
    if invariant.hold is None or not waits(invariant):
        return True
    since = situation.false_since[execution, invariant.name]
    return situation.now_ns >= since + nanoseconds(invariant.hold.for_s)


def is_stuck(skill: Skill, execution: Running, situation: Situation) -> bool:
    """Return whether an execution has made no progress for as long as it may."""
    if execution.id not in situation.progressed or skill.progress is None or skill.progress.deadline_s is None:
        return False
    return situation.now_ns >= situation.progressed[execution.id] + nanoseconds(skill.progress.deadline_s)


def _durations(skillset: Skillset, situation: Situation) -> Iterator[int]:
    for (execution, name), since_ns in situation.false_since.items():
        holds = [one.hold for one in skillset.skill(execution.skill).invariants if one.name == name]
        yield from (since_ns + nanoseconds(hold.for_s) for hold in holds if hold is not None)


def _deadlines(skillset: Skillset, situation: Situation) -> Iterator[int]:
    for execution in situation.running:
        progress = skillset.skill(execution.skill).progress
        if execution.id in situation.progressed and progress is not None and progress.deadline_s is not None:
            yield situation.progressed[execution.id] + nanoseconds(progress.deadline_s)
