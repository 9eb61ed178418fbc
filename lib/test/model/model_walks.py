"""Walks through a model by its semantics alone: random steps, with data and time."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

from prove_models import VALUES

from alula.model import semantics
from alula.model.deadlines import due_ns
from alula.model.execution_state import ExecutionState
from alula.model.situation import Change, Entered, Running, Situation, Step

MS = 1_000_000


@dataclass(frozen=True)
class Taken:
    """A step that was taken; ``execution``: the one that it is about."""

    act: str
    before: Situation
    step: Step
    execution: Running | None = None
    name: str = ""

    @property
    def changes(self) -> list[Change]:
        return [one for one in self.step.happenings if isinstance(one, Change)]

    @property
    def entered(self) -> list[Entered]:
        return [one for one in self.step.happenings if isinstance(one, Entered)]


def walk(skillset, seed, steps):
    """Return random steps from the initial situation, each from where the one before has led.

    Time passes between them; where something is due then, it is ended first, as managers do.
    """
    chance = random.Random(seed)  # noqa: S311 - nothing here is secret
    situation, taken = semantics.initial(skillset), []
    for number in range(steps):
        situation = replace(situation, now_ns=situation.now_ns + chance.choice([0, 0, 400, 1100]) * MS)
        due = due_ns(skillset, situation)
        if due is not None and due <= situation.now_ns:
            taken.append(Taken("time", situation, semantics.elapse(skillset, situation)))
            situation = taken[-1].step.situation
        taken.append(_take(skillset, situation, chance, number))
        situation = taken[-1].step.situation
    return taken


def _take(skillset, situation, chance, number):
    acts = [lambda: Taken("time", situation, semantics.elapse(skillset, situation))]
    for skill in skillset.skills:
        execution = Running(str(number), skill.name)
        begun = Taken("start", situation, semantics.start(skillset, situation, execution), execution)
        acts += [lambda begun=begun: begun] * (1 if begun.entered[0].state is ExecutionState.NOT_READY else 6)
    for resource in skillset.resources:
        for target in resource.targets(situation.states[resource.name], extern=True):
            acts.append(lambda name=resource.name, to=target: _extern(skillset, situation, name, to))
    for event in skillset.events:
        if not semantics.event_refusal(skillset, situation, event.name):
            acts.append(lambda name=event.name: Taken("event", situation, semantics.event(skillset, situation, name)))
    for value in (*VALUES, None) if skillset.data else ():
        acts.append(lambda value=value: Taken("value", situation, semantics.receive(skillset, situation, "d", value)))
    if situation.running:
        acts += [lambda: _end(skillset, situation, chance)] * 4
    return chance.choice(acts)()


def _extern(skillset, situation, name, target):
    return Taken("extern", situation, semantics.transition(skillset, situation, name, target), name=name)


def _end(skillset, situation, chance):
    execution = chance.choice(situation.running)
    skill = skillset.skill(execution.skill)
    ends = {
        "terminate": lambda: semantics.terminate(skillset, situation, execution, name),
        "interrupt": lambda: semantics.interrupt(skillset, situation, execution),
        "fail": lambda: semantics.fail(skillset, situation, execution, "asked to"),
        "lose": lambda: semantics.lose(skillset, situation, execution, name),
    }
    act = chance.choice([one for one in ends if one != "lose" or skill.invariants])
    names = skill.invariants if act == "lose" else skill.results
    name = chance.choice(["NOSUCH", *(one.name for one in names)]) if act == "terminate" else chance.choice(names).name
    return Taken(act, situation, ends[act](), execution, name)
