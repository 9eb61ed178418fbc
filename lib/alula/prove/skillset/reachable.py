"""The global checks, over all situations that can be reached one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from alula.common.graphs import reachable_from
from alula.language.counterexamples import Counterexample
from alula.language.errors import Diagnostic, Severity
from alula.model.model import Skill, Skillset
from alula.model.span import Span
from alula.prove.skillset import counterexample
from alula.prove.skillset.explore import Graph
from alula.prove.skillset.local import Suspect
from alula.prove.skillset.steps import Key, State

MANY = 6
"""More states of one resource than this are not listed one by one."""
NEVER_SEEN = "no reachable situation shows it"


def decide(skillset: Skillset, graph: Graph, suspects: Iterable[Suspect]) -> list[Diagnostic]:
    """Return the decided suspects: an error with its counterexample, or a warning that it is out of reach."""
    counterexamples = {fault: counterexample.to(graph, number, move, fault) for fault, (number, move) in graph.faults.items()}
    return judged(skillset, suspects, counterexamples)


def judged(skillset: Skillset, suspects: Iterable[Suspect], counterexamples: Mapping[Key, Counterexample]) -> list[Diagnostic]:
    """Return the suspects and further faults; ``counterexamples`` has those that are reached."""
    findings: list[Diagnostic] = []
    told: set[Key] = set()
    for suspect in suspects:
        if suspect.key in counterexamples:
            told.add(suspect.key)
            findings.append(replace(suspect.finding, counterexample=counterexamples[suspect.key]))
        else:
            message = f"{suspect.finding.message}, but {NEVER_SEEN}"
            findings.append(replace(suspect.finding, message=message, severity=Severity.WARNING))
    for fault, run in counterexamples.items():
        if fault not in told and fault[0] == "effect":
            message = f"the effect of {named(fault)} fails in a reachable situation"
            findings.append(Diagnostic("ALU525", message, _place(skillset, fault), counterexample=run))
    return findings


def check_graph(skillset: Skillset, graph: Graph) -> list[Diagnostic]:
    """Return unreachable states, dead skills, resources held twice and skills that can be lost for ever."""
    dead = [skill for skill in skillset.skills if not graph.started[skill.name] and not _start_fails(graph, skill)]
    findings = unreachable_states(skillset, [{state.resources[i] for state in graph.states} for i in range(len(skillset.resources))])
    findings += [dead_skill(skill) for skill in dead]
    findings += _held_twice(skillset, graph)
    findings += _lost_skills(skillset, graph)
    return findings


def _start_fails(graph: Graph, skill: Skill) -> bool:
    return ("effect", "start", skill.name) in graph.faults


# --- findings, for both ways of searching -----------------------------------------------------------------------------


def unreachable_states(skillset: Skillset, seen: list[set[str]]) -> list[Diagnostic]:
    """Return ALU521 for states that a path of transitions leads to, but no execution."""
    findings = []
    for resource, states in zip(skillset.resources, seen, strict=True):
        by_transitions = resource.reachable()
        missing = [state for state in resource.states if state not in states and state in by_transitions]
        if missing:
            more = f" and {len(missing) - MANY} more" if len(missing) > MANY else ""
            names = ", ".join(f"`{state}`" for state in missing[:MANY])
            hint = "nothing that can happen makes the transitions that lead there"
            findings.append(Diagnostic("ALU521", f"`{resource.name}` never gets to {names}{more}", resource.span, Severity.WARNING, hint))
    return findings


def dead_skill(skill: Skill) -> Diagnostic:
    """Return ALU522: the skill's preconditions hold in no reachable situation."""
    message = f"`{skill.name}` can never start: its preconditions are true in no reachable situation"
    return Diagnostic("ALU522", message, skill.span, Severity.WARNING)


def held_twice(skillset: Skillset, resource: str, state: str, pair: tuple[str, str], run: Counterexample) -> Diagnostic:
    """Return ALU523: two executions, of the ``pair`` of skills, hold a resource at once, each by taking it to ``state``."""
    first, second = pair
    holders = f"two executions of `{first}`" if first == second else f"`{first}` and `{second}`"
    message = f"{holders} can hold `{resource}` at once: each has taken it to `{state}`"
    hint = f"let a precondition ask that `{resource}` is free, and an invariant that it is still taken"
    return Diagnostic("ALU523", message, skillset.skill(second).span, hint=hint, counterexample=run)


def lost(skillset: Skillset, names: list[str], run: Counterexample) -> Diagnostic:
    """Return ALU524: after ``run``, none of the skills named can ever start again."""
    several = ", ".join(f"`{name}`" for name in names)
    message = f"{several} can come to a situation from which {'it' if len(names) == 1 else 'they'} can never start again"
    return Diagnostic("ALU524", message, skillset.skill(names[0]).span, Severity.WARNING, counterexample=run)


def crowded(skillset: Skillset, names: set[str], copies: int) -> list[Diagnostic]:
    """Return ALU526 for skills of which more executions can run at once than were looked at."""
    return [
        Diagnostic(
            "ALU526",
            f"more than {copies} executions of `{skill.name}` can run at once; the proof looks at no more than that",
            skill.span,
            Severity.WARNING,
            "let a precondition and an invariant exclude each other, so that it runs once",
        )
        for skill in skillset.skills
        if skill.name in names
    ]


def takes(skill: Skill) -> dict[str, str]:
    """Return the states that a skill's start effect puts resources in."""
    return {change.resource: change.target for change in skill.start.assignments}


# --- searches ---------------------------------------------------------------------------------------------------------


def _held_twice(skillset: Skillset, graph: Graph) -> list[Diagnostic]:
    taken = {skill.name: takes(skill) for skill in skillset.skills}
    findings: dict[tuple[str, str, str], Diagnostic] = {}
    for number, state in enumerate(graph.states):
        graph.deadline.check()
        for resource, first, second in _pairs(skillset, state, taken):
            key = (resource, first, second)
            if key not in findings:
                value = taken[first][resource]
                findings[key] = held_twice(skillset, resource, value, (first, second), counterexample.to(graph, number))
    return list(findings.values())


def _pairs(skillset: Skillset, state: State, taken: Mapping[str, Mapping[str, str]]) -> Iterable[tuple[str, str, str]]:
    if len(state.running) < 2:
        return
    for resource, value in zip(skillset.resources, state.resources, strict=True):
        # In the model's order, so that a pair has one name whichever started first.
        holders = [
            skill.name
            for skill in skillset.skills
            for name in state.running
            if name == skill.name and taken[name].get(resource.name) == value
        ]
        for index, first in enumerate(holders):
            for second in holders[index + 1 :]:
                yield resource.name, first, second


def _lost_skills(skillset: Skillset, graph: Graph) -> list[Diagnostic]:
    sources = graph.backwards()
    stuck: dict[int, list[str]] = {}
    for skill in skillset.skills:
        starts = graph.started[skill.name]
        if not starts:
            continue
        graph.deadline.check()
        hopeful = reachable_from(starts, sources.__getitem__)
        if len(hopeful) < len(graph.states):
            number = next(n for n in range(len(graph.states)) if n not in hopeful)
            stuck.setdefault(number, []).append(skill.name)
    return [lost(skillset, names, counterexample.to(graph, number)) for number, names in sorted(stuck.items())]


# --- words ------------------------------------------------------------------------------------------------------------


def named(fault: Key) -> str:
    """Return the name of a fault's place for messages."""
    kind, *names = fault[1:]
    match kind:
        case "event":
            return f"event `{names[0]}`"
        case "start":
            return f"the start of `{names[0]}`"
        case "interrupt":
            return f"the interruption of `{names[0]}`"
        case _:
            return f"{kind} `{names[1]}` of `{names[0]}`"


def _place(skillset: Skillset, fault: Key) -> Span:
    kind, *names = fault[1:]
    if kind == "event":
        return next(event.span for event in skillset.events if event.name == names[0])
    skill = skillset.skill(names[0])
    match kind:
        case "invariant":
            return next(one.span for one in skill.invariants if one.name == names[1])
        case "result":
            return skill.result(names[1]).span
        case "interrupt" if skill.interrupt.span.line:
            return skill.interrupt.span
        case _:
            return skill.span
