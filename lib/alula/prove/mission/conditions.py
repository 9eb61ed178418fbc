"""Conditions of properties, in situations of a mission."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

from alula.model.expressions import And, Constant, Expression, Implies, MissionIs, Not, Or, ResourceIs, SkillRuns
from alula.prove.mission.state import Event, Kind, State
from alula.prove.mission.system import System

Faults = Mapping[str, frozenset[str]]
"""By its name the states that show a fault, ``skillset.resource STATE``; ``*`` stands for anything."""
NO_FAULTS: Faults = {}


def true_in(system: System, condition: Expression, state: State, shown: frozenset[str] = frozenset()) -> bool:
    """Return whether a condition is true in a situation; ``shown`` are the faults that the step to it has shown."""
    match condition:
        case ResourceIs(resource=resource, state=value, negated=negated):
            return (system.resource(state, resource) == value) != negated
        case SkillRuns(skill=skill):
            return system.running(state, skill)
        case MissionIs(what="active", name=name):
            return any(node.name == name for node in system.active(state))
        case MissionIs(what="outcome", name=name):
            end = system.outcome(state)
            return end is not None and end.value == name
        case MissionIs(name=name):
            return name in shown
        case Constant(value=value):
            return value
        case Not(operand=operand):
            return not true_in(system, operand, state, shown)
        case And(operands=operands):
            return all(true_in(system, one, state, shown) for one in operands)
        case Or(operands=operands):
            return any(true_in(system, one, state, shown) for one in operands)
        case Implies(premise=premise, conclusion=conclusion):
            return not true_in(system, premise, state, shown) or true_in(system, conclusion, state, shown)
        case _:
            raise ValueError(f"a property can't ask data: {condition}")


def faults_shown(event: Event, faults: Faults) -> frozenset[str]:
    """Return the faults that the functional layer shows in a step."""
    if event.kind is not Kind.EXTERN:
        return frozenset()
    told = f"{event.skill} {event.result}"
    return frozenset(name for name, states in faults.items() if any(fnmatchcase(told, pattern) for pattern in states))
