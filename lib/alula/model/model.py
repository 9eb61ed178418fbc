"""The skill model: plain, typed values that both notations read into and everything else is made from.

Resources are state machines (paper, section 4.1.1), skills have preconditions, a start effect, invariants and results
(section 4.1.2). Nothing here knows of files, ROS or execution. Every named element carries the place in the source that
it came from, so that a tool that finds something wrong with it can show where.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property

from alula.common.graphs import reachable_from
from alula.common.public import public
from alula.model.expressions import TRUE, Comparison, DataIs, Expression
from alula.model.span import NOWHERE, Span

_INCLUSIVE = {Comparison.GT: Comparison.GE, Comparison.LT: Comparison.LE}


@dataclass(frozen=True)
class Parameter:
    """A typed name: an input, an output or a parameter (``default`` is its source text, or empty)."""

    name: str
    type: str
    default: str = ""
    comment: str = ""
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Data:
    """A value that the functional layer publishes. ``period_s`` is None where no period is promised, ``unit`` empty where none is told."""

    name: str
    type: str
    period_s: float | None = None
    unit: str = ""
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Transition:
    """A transition of a resource; an extern one is made by the functional layer only, others by skills only."""

    source: str
    target: str
    extern: bool = False
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Resource:
    """A state machine. ``states`` keeps the order of the source.

    ``all_transitions`` tells that every transition that is not extern was asked for by ``transition all``; they are in ``transitions``.

    ``silence_s``: when its reporter has not been heard of for so many seconds, the managers take the resource back to its initial state,
    which then means unknown. Those extern transitions are in ``transitions`` as well, the last of them. None: it is never taken back.
    """

    name: str
    states: tuple[str, ...]
    initial: str
    transitions: tuple[Transition, ...]
    all_transitions: bool = False
    silence_s: float | None = None
    span: Span = field(default=NOWHERE, compare=False)

    def has_transition(self, source: str, target: str, *, extern: bool) -> bool:
        """Return whether the functional layer (extern) or a skill (not extern) may go from source to target."""
        return target in self._targets.get((source, extern), ())

    def targets(self, source: str, *, extern: bool) -> tuple[str, ...]:
        """Return where the functional layer (extern) or skills (not extern) may go from a state, in the order of the source."""
        return tuple(self._targets.get((source, extern), ()))

    def reachable(self) -> frozenset[str]:
        """Return the states with a path of transitions from the initial one, extern or not."""
        return frozenset(
            reachable_from([self.initial], lambda state: (*self.targets(state, extern=False), *self.targets(state, extern=True)))
        )

    @cached_property
    def _targets(self) -> Mapping[tuple[str, bool], Mapping[str, None]]:
        """The transitions by source and kind; the targets of each in the order of the source."""
        index: dict[tuple[str, bool], dict[str, None]] = {}
        for transition in self.transitions:
            index.setdefault((transition.source, transition.extern), {})[transition.target] = None
        return index


@dataclass(frozen=True)
class Assignment:
    """One step of an effect: ``resource -> target``."""

    resource: str
    target: str
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Effect:
    """A set of resource changes applied as one; an empty one changes nothing (paper, Listing 3: ``reset {}``).

    ``name`` is empty where the notation writes the changes in place.
    """

    name: str = ""
    assignments: tuple[Assignment, ...] = ()
    span: Span = field(default=NOWHERE, compare=False)


NO_EFFECT = Effect()


@dataclass(frozen=True)
class Event:
    """Something that happens in the skillset by itself: when ``guard`` holds, ``effect`` may be applied."""

    name: str
    guard: Expression = TRUE
    effect: Effect = NO_EFFECT
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Precondition:
    """A named condition that must hold when the skill starts."""

    name: str
    condition: Expression
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Hold:
    """How long an invariant's condition may be false, and when it is true again (``fps >= 10 for 2 s recovers at 12``).

    It is broken when its condition has been false for ``for_s`` seconds without a break. With ``hysteresis`` a value that fell
    through the condition's threshold is good again only from that value on (in ``unit``, empty for the condition's own).
    """

    for_s: float = 0.0
    hysteresis: float | None = None
    unit: str = ""
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Invariant:
    """A named condition that must hold while the skill runs; ``effect`` is applied when it is broken.

    Without ``hold`` it is broken as soon as the condition is false.
    """

    name: str
    condition: Expression
    effect: Effect = NO_EFFECT
    hold: Hold | None = None
    span: Span = field(default=NOWHERE, compare=False)

    @property
    def recovered(self) -> Expression:
        """Return the condition of a value that had fallen and is good again: the recovery value itself is."""
        condition, hold = self.condition, self.hold
        if hold is None or hold.hysteresis is None or not isinstance(condition, DataIs):
            return condition
        comparison = _INCLUSIVE.get(condition.comparison, condition.comparison)
        return replace(condition, comparison=comparison, value=hold.hysteresis, unit=hold.unit or condition.unit)


@dataclass(frozen=True)
class Progress:
    """Every ``period_s`` seconds a running skill reports.

    ``message`` names the type of the report, or is empty; ``outputs`` are the values in it that have names of their own.

    An execution that has not made progress for ``deadline_s`` seconds is stuck; None where no deadline is given.
    """

    period_s: float
    message: str = ""
    deadline_s: float | None = None
    outputs: tuple[Parameter, ...] = ()
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Interrupt:
    """What an interruption does: whether it takes time, its effect, and what must hold after it.

    A stop that is not done after ``timeout_s`` seconds is an emergency; None leaves the limit to the managers.
    """

    interrupting: bool = False
    effect: Effect = NO_EFFECT
    postcondition: Expression = TRUE
    timeout_s: float | None = None
    span: Span = field(default=NOWHERE, compare=False)


class ResultKind(Enum):
    """What a result is called; a plain one has no word. What that means is said by ``Skill.kind_of`` alone."""

    PLAIN = "result"
    SUCCESS = "success"
    FAILURE = "failure"


@dataclass(frozen=True)
class Result:
    """A way in which the skill can end by itself, its effect, and what must hold after the effect."""

    name: str
    kind: ResultKind = ResultKind.PLAIN
    effect: Effect = NO_EFFECT
    postcondition: Expression = TRUE
    comment: str = ""
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Role:
    """What skills are for, by a name that all skillsets of a robot share: skills of one role can take each other's place."""

    name: str
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Skill:
    """A capability. ``effects`` are the named ones of the paper's notation; start, invariants and results refer to them.

    ``provides``: its roles, filled while it runs, or, of a skill that can succeed, once it has. ``needs``: roles that others have to fill
    while it runs. ``achieves``: what is true after a success, besides what its effects say. Managers do not look at these: plans do.
    """

    name: str
    parameters: tuple[Parameter, ...] = ()
    inputs: tuple[Parameter, ...] = ()
    outputs: tuple[Parameter, ...] = ()
    effects: tuple[Effect, ...] = ()
    preconditions: tuple[Precondition, ...] = ()
    start: Effect = NO_EFFECT
    invariants: tuple[Invariant, ...] = ()
    progress: Progress | None = None
    interrupt: Interrupt = Interrupt()
    results: tuple[Result, ...] = ()
    provides: tuple[Role, ...] = ()
    needs: tuple[Role, ...] = ()
    achieves: Expression = TRUE
    span: Span = field(default=NOWHERE, compare=False)

    @property
    def successes(self) -> tuple[Result, ...]:
        """The results that are successes; none: the skill is there to run."""
        return tuple(one for one in self.results if self.kind_of(one.name) is ResultKind.SUCCESS)

    def result(self, name: str) -> Result:
        """Return the result of this name; raise KeyError with the names there are."""
        for result in self.results:
            if result.name == name:
                return result
        raise KeyError(f"skill {self.name} has no result {name}; it has {', '.join(r.name for r in self.results)}")

    def kind_of(self, result_name: str) -> ResultKind:
        """Return whether a result is a success or a failure; PLAIN: neither, the mission decides. Raise KeyError as ``result``.

        It is what it is called. Where no result of the skill is called either, as in the paper's listings, the first one is the
        success and the others are failures.
        """
        kind = self.result(result_name).kind
        if any(result.kind is not ResultKind.PLAIN for result in self.results):
            return kind
        return ResultKind.SUCCESS if result_name == self.results[0].name else ResultKind.FAILURE


class PropertyKind(Enum):
    """What a property says about the states that can be reached."""

    NEVER = "never"
    ALWAYS = "always"
    EVENTUALLY = "eventually"
    LEADS_TO = "leads to"


@dataclass(frozen=True)
class Property:
    """What the user wants proved. ``condition`` asks resource states and executions (``SkillRuns``), never data.

    NEVER: no reachable state fulfils ``condition``; ALWAYS: every one does; EVENTUALLY: every run gets to one that does;
    LEADS_TO: after each state that fulfils ``condition`` the run gets to one that fulfils ``consequence`` (None for the other
    kinds). ``fair`` (written ``assuming termination``): only runs in which no execution stays RUNNING for ever are looked at.
    ``within``: of a mission, after how many ticks of its tree at most; 0: some time.
    """

    name: str
    kind: PropertyKind
    condition: Expression
    consequence: Expression | None = None
    fair: bool = False
    within: int = 0
    span: Span = field(default=NOWHERE, compare=False)


@public()
@dataclass(frozen=True)
class Skillset:
    """Skills of one subsystem with the data and resources that they share (paper, section 4.1).

    ``uses`` names other skillsets of the robot whose types are known here, too.
    """

    name: str
    types: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    data: tuple[Data, ...] = ()
    resources: tuple[Resource, ...] = ()
    events: tuple[Event, ...] = ()
    skills: tuple[Skill, ...] = ()
    properties: tuple[Property, ...] = ()
    uses: tuple[str, ...] = ()
    span: Span = field(default=NOWHERE, compare=False)

    def resource(self, name: str) -> Resource:
        """Return the resource of this name; raise KeyError."""
        if name in self.resource_index:
            return self.resource_index[name]
        raise KeyError(f"skillset {self.name} has no resource {name}; it has {', '.join(r.name for r in self.resources)}")

    def skill(self, name: str) -> Skill:
        """Return the skill of this name; raise KeyError."""
        if name in self.skill_index:
            return self.skill_index[name]
        raise KeyError(f"skillset {self.name} has no skill {name}; it has {', '.join(s.name for s in self.skills)}")

    @cached_property
    def resource_index(self) -> Mapping[str, Resource]:
        """The resources by name; of two of one name the first."""
        return {resource.name: resource for resource in reversed(self.resources)}

    @cached_property
    def skill_index(self) -> Mapping[str, Skill]:
        """The skills by name; of two of one name the first."""
        return {skill.name: skill for skill in reversed(self.skills)}

    @cached_property
    def data_index(self) -> Mapping[str, Data]:
        """The data by name; of two of one name the first."""
        return {data.name: data for data in reversed(self.data)}
