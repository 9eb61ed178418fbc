"""What a mock does: plain values, made of a behaviour file (``reading``) or by a test.

A skill has rules. For each thing that a rule can say (how long, how it ends, progress, outputs, transitions, what it moves), the
first rule that applies to the call and says it counts; so a rule for one call need not repeat the rest, and the rules of another
file can be put in front of those that are there. What no rule says is as in ``default_script``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from alula.common.faults import FaultRequest
from alula.common.located_yaml import choices
from alula.common.public import public
from alula.mock.formula import Formula
from alula.model.model import ResultKind, Skill
from alula.runtime.core.errors import SkillRuntimeError

Value = Formula | float | str | bool | Callable[..., object]
"""A constant, a formula, or (in tests) a function of the names, ``f(names) -> value``."""

DEFAULT_DELAY_S = 1.0

Place = tuple[str, str]
"""Skillset and name of a resource, a skill or a data."""


@dataclass(frozen=True)
class Ending:
    """How an execution ends: one of these. ``results`` with weights; none of them: it runs until it is stopped."""

    results: tuple[tuple[str, float], ...] = ()
    refuse: str = ""
    crash: str = ""
    message: str = ""


NEVER = Ending()


@dataclass(frozen=True)
class MockChange:
    """Extern transitions after a delay in seconds: changes that the functional layer reports."""

    after_s: Value
    states: Mapping[Place, str]


@dataclass(frozen=True, kw_only=True)
class Rule:
    """What a mock does in the calls that the rule applies to; of a field that is None, a later rule decides.

    ``call`` counts from 1, ``when`` is about the inputs, ``chance`` is a probability; all that are given must hold. ``progress`` is
    a formula of ``t`` (seconds since the start) and ``f`` (part of the delay, 0 to 1), or points (f, value). ``moves`` says where
    parts of the memory get to, little by little; a skill that is stopped half-way leaves them half-way.
    """

    call: int | None = None
    when: Value | None = None
    chance: float | None = None
    delay: Value | None = None
    ending: Ending | None = None
    progress: Value | tuple[tuple[float, float], ...] | None = None
    outputs: Mapping[str, Value] | None = None
    changes: tuple[MockChange, ...] | None = None
    moves: Mapping[str, Value] | None = None
    source: str = ""


@dataclass(frozen=True, kw_only=True)
class Script:
    """What a mock does in one call, as the fields of the same names in ``Rule``."""

    delay: Value
    ending: Ending
    progress: Value | tuple[tuple[float, float], ...]
    outputs: Mapping[str, Value]
    changes: tuple[MockChange, ...]
    moves: Mapping[str, Value]


@dataclass(frozen=True)
class TimelineEvent:
    """Extern transitions by the clock: so many seconds after the start, or after a resource has first entered a state."""

    after_s: Value
    states: Mapping[Place, str]
    anchor: tuple[Place, str] | None = None
    source: str = ""


@dataclass(frozen=True)
class MockFault:
    """Something that a user can have fail: noticed ``delay`` seconds after it happened; its time counts from the ``anchor``.

    ``changes`` are what the robot does about it by itself, after it was noticed: a failsafe that lands, for instance. ``ends``: the skills
    whose running executions it ends, and with which result. ``reason``: of its states, in words; empty: that it is this fault.
    """

    states: Mapping[Place, str]
    delay: Value = 0.0
    anchor: tuple[Place, str] | None = None
    changes: tuple[MockChange, ...] = ()
    ends: Mapping[Place, str] = field(default_factory=dict)
    source: str = ""
    reason: str = ""


@dataclass(frozen=True)
class DataScript:
    """Values of a data, published every ``period_s``; ``steps``: (from seconds on, value or None for silence), or one formula of ``t``."""

    period_s: float
    steps: tuple[tuple[float, object], ...]
    source: str = ""


@public()
@dataclass(frozen=True, kw_only=True)
class Behaviour:
    """What the mocks of a robot do: rules of skills, timed events, faults and data, over one memory.

    ``beside``: the behaviours of other robots of a fleet, each with a memory of its own.
    """

    memory: Mapping[str, object] = field(default_factory=dict)
    rules: Mapping[Place, tuple[Rule, ...]] = field(default_factory=dict)
    timeline: tuple[TimelineEvent, ...] = ()
    faults: Mapping[str, MockFault] = field(default_factory=dict)
    data: Mapping[Place, DataScript] = field(default_factory=dict)
    beside: tuple[Behaviour, ...] = ()

    def over(self, other: Behaviour) -> Behaviour:
        """Return the union of two behaviours: this one's rules come first, its memory, faults and data replace those of the same name."""
        rules = {place: (*self.rules.get(place, ()), *other.rules.get(place, ())) for place in {**other.rules, **self.rules}}
        return Behaviour(
            memory={**other.memory, **self.memory},
            rules=rules,
            timeline=(*other.timeline, *self.timeline),
            faults={**other.faults, **self.faults},
            data={**other.data, **self.data},
            beside=(*other.beside, *self.beside),
        )

    def named(self, name: Callable[[str], str]) -> Behaviour:
        """Return a copy in which ``name`` has mapped the names of skillsets and faults."""

        def states(said: Mapping[Place, str]) -> dict[Place, str]:
            return {(name(skillset), member): state for (skillset, member), state in said.items()}

        def anchor(said: tuple[Place, str] | None) -> tuple[Place, str] | None:
            return None if said is None else ((name(said[0][0]), said[0][1]), said[1])

        def changes(said: tuple[MockChange, ...]) -> tuple[MockChange, ...]:
            return tuple(replace(change, states=states(change.states)) for change in said)

        def rule(said: Rule) -> Rule:
            return said if said.changes is None else replace(said, changes=changes(said.changes))

        return Behaviour(
            memory=self.memory,
            rules={(name(skillset), skill): tuple(map(rule, rules)) for (skillset, skill), rules in self.rules.items()},
            timeline=tuple(replace(one, states=states(one.states), anchor=anchor(one.anchor)) for one in self.timeline),
            faults={
                name(what): replace(
                    one, states=states(one.states), anchor=anchor(one.anchor), changes=changes(one.changes), ends=states(one.ends)
                )
                for what, one in self.faults.items()
            },
            data={(name(skillset), data): script for (skillset, data), script in self.data.items()},
            beside=tuple(one.named(name) for one in self.beside),
        )

    def about(self, skillset: str) -> bool:
        """Return whether it has rules for a skillset itself, not in ``beside``."""
        said = [*self.rules, *self.data, *(place for event in self.timeline for place in event.states)]
        said += [place for fault in self.faults.values() for place in (*fault.states, *fault.ends)]
        return any(place[0] == skillset for place in said)

    def fault(self, request: FaultRequest) -> tuple[str, MockFault]:
        """Return the fault that a request asks for, and its name: ``thing:how`` where it is defined, else ``thing``.

        Raises:
            SkillRuntimeError: there is none.
        """
        faults = {name: fault for one in (self, *self.beside) for name, fault in one.faults.items()}
        name = next((name for name in (f"{request.what}:{request.how}", request.what) if name in faults), None)
        if name is None:
            raise SkillRuntimeError(f"there is no fault '{request.what}' in the behaviour; it has {choices(request.what, faults)}")
        return name, faults[name]

    def of(self, skillsets: frozenset[str]) -> Behaviour:
        """Return the part about these skillsets, for a process that serves no others."""

        def inside(states: Mapping[Place, str], anchor: tuple[Place, str] | None) -> bool:
            return all(skillset in skillsets for skillset, _ in (*states, *(() if anchor is None else (anchor[0],))))

        def trimmed(rule: Rule) -> Rule:
            return replace(rule, changes=None if rule.changes is None else tuple(c for c in rule.changes if inside(c.states, None)))

        return Behaviour(
            memory=self.memory,
            rules={place: tuple(map(trimmed, rules)) for place, rules in self.rules.items() if place[0] in skillsets},
            timeline=tuple(entry for entry in self.timeline if inside(entry.states, entry.anchor)),
            faults={name: fault for name, fault in self.faults.items() if inside({**fault.states, **fault.ends}, fault.anchor)},
            data={place: script for place, script in self.data.items() if place[0] in skillsets},
            beside=tuple(one.of(skillsets) for one in self.beside),
        )


def default_script(skill: Skill) -> Script:
    """Return what a mock does without a rule: the first result that is a success, after a second; else it runs until it is stopped.

    The progress rises evenly; of a skill that does not end by itself it is 1 at once.
    """
    wanted = [result.name for result in skill.results if skill.kind_of(result.name) is ResultKind.SUCCESS]
    return Script(
        delay=DEFAULT_DELAY_S,
        ending=Ending(results=((wanted[0], 1.0),)) if wanted else NEVER,
        progress=((0.0, 0.0), (1.0, 1.0)) if wanted else 1.0,
        outputs={},
        changes=(),
        moves={},
    )


def cascade(rules: Sequence[Rule], script: Script) -> Script:
    """Return the script after the rules that apply; for each field the first rule that has it counts."""
    for rule in reversed(rules):
        said = {name: value for name in vars(script) if (value := getattr(rule, name)) is not None}
        script = replace(script, **said)
    return script
