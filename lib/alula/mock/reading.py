"""Reads behaviour files, and checks them against the models: names of skills, results, inputs, outputs, resources, states, data."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from alula.common.keys import Key
from alula.common.located_yaml import Located, choices, read_yaml
from alula.common.public import public
from alula.mock.behaviour import (
    DEFAULT_DELAY_S,
    NEVER,
    Behaviour,
    DataScript,
    Ending,
    MockChange,
    MockFault,
    Place,
    Rule,
    TimelineEvent,
    Value,
)
from alula.mock.errors import BehaviourError
from alula.mock.formula import NO_RESOURCES, Formula, FormulaError
from alula.model.model import Skill, Skillset

SECTIONS = ("memory", "skills", "timeline", "faults", "data")
ENDINGS = ("result", "refuse", "crash", "never")
RULE: Mapping[str, Key] = {
    "call": Key("condition: the third request of this skill (`3`), refused ones counted", "each"),
    "when": Key("condition: a formula over inputs and memory, `target.x > 40`", "always"),
    "chance": Key("condition: in so many of the calls, `0.1`", "all"),
    "delay": Key("seconds from the start to the end: `2 + height / speed`", f"{DEFAULT_DELAY_S:g}"),
    "result": Key("how it ends, `ARRIVED`, or with weights, `{ARRIVED: 9, BLOCKED: 1}`", "its first success"),
    "message": Key("the text that goes with `result`"),
    "refuse": Key("a text: `validate` refuses, NOT_VALIDATED"),
    "crash": Key("a text: the function raises (after the delay, if one is given): FAILED"),
    "never": Key("`true`: runs until it is interrupted or violated", "if it has no success"),
    "progress": Key(
        "formula of `t` (seconds), `f` (part of the delay), `delay`, as `f * f`; or points (part, progress), `[[0, 0], [0.5, 0.2], [1, 1]]`"
    ),
    "outputs": Key("outputs of the model, `{reached: height}`; text for a `string`, formulas for the rest"),
    "then": Key(
        "extern transitions while it runs, `[{after: 2.5, set: {navigation.flight_status: IN_AIR}}]`; none once it was stopped",
        "none",
    ),
    "moves": Key(
        'brings a part of the memory there, evenly over the delay; stopped half-way, it is half-way: `{position: "[target.x, target.y]"}`'
    ),
}
"""What a rule may say: conditions of the call, and what it does."""
DEFAULT_PERIOD_S = 0.5
States = Mapping[str, Sequence[str]]
"""Resources that a formula may ask for, with their states."""
T = TypeVar("T")


@public()
def load_behaviour(paths: Sequence[str | Path], skillsets: Sequence[Skillset]) -> Behaviour:
    """Read behaviour files of mocks; the rules of a later file come before those of an earlier one.

    Raises:
        BehaviourError: with file, line, what is wrong and what would be right.
    """
    documents = [(path, read_yaml(path, BehaviourError)) for path in map(Path, paths)]
    sections = [(path, {} if top is None else top.record("a behaviour file", SECTIONS)) for path, top in documents]
    memory: dict[str, object] = {}
    for _, parts in sections:
        if "memory" in parts:
            memory |= {name: part.value for name, part in parts["memory"].entries("memory").items()}
    reader = _Reader({skillset.name: skillset for skillset in skillsets}, memory)
    silent = Behaviour(memory=memory, faults=_silences(skillsets))
    return functools.reduce(lambda below, parts: reader.read(parts[1]).over(below), sections, silent)


def _silences(skillsets: Sequence[Skillset]) -> dict[str, MockFault]:
    """Return the faults ``RESOURCE:silent``: resources of this name that have a silence are no longer reported."""
    found: dict[str, MockFault] = {}
    for skillset in skillsets:
        for one in skillset.resources:
            if one.silence_s is not None:
                name = f"{one.name}:silent"
                states = {**(found[name].states if name in found else {}), (skillset.name, one.name): one.initial}
                found[name] = MockFault(states, delay=one.silence_s, reason=f"not heard of for {one.silence_s:g} s")
    return found


class _Reader:
    """The meaning of names while files are read."""

    def __init__(self, skillsets: Mapping[str, Skillset], memory: Mapping[str, object]) -> None:
        self._skillsets = skillsets
        self._memory = frozenset(memory)

    def read(self, parts: Mapping[str, Located]) -> Behaviour:
        entries = {name: parts[name].entries(name) if name in parts else {} for name in ("skills", "faults", "data")}
        return Behaviour(
            rules=dict(self._skill(name, part) for name, part in entries["skills"].items()),
            timeline=tuple(self._timeline_event(part) for part in (parts["timeline"].elements() if "timeline" in parts else ())),
            faults={name: self._fault(name, part) for name, part in entries["faults"].items()},
            data=dict(self._data(name, part) for name, part in entries["data"].items()),
        )

    # --- skills ------------------------------------------------------------------------------------------------------

    def _skill(self, name: str, part: Located) -> tuple[Place, tuple[Rule, ...]]:
        skillset, member = self._member(name, part, "skill")
        skill = self._one(member, {skill.name: skill for skill in skillset.skills}, part, f"skillset {skillset.name}", "skill")
        return (skillset.name, member), tuple(self._rule(name, skill, rule) for rule in part.elements())

    def _rule(self, name: str, skill: Skill, part: Located) -> Rule:
        said = part.record(f"a rule of {name}", RULE)
        inputs = {parameter.name for parameter in skill.inputs}
        known = inputs | self._memory
        running = known | {"delay"}
        call = said["call"].number("`call`", 1) if "call" in said else None
        if call is not None and not call.is_integer():
            raise said["call"].wrong(f"`call` counts calls from 1, {call:g} is none")
        return Rule(
            call=None if call is None else int(call),
            when=self._value(said["when"], known) if "when" in said else None,
            chance=said["chance"].number("`chance`", 0.0, 1.0) if "chance" in said else None,
            delay=self._duration(said["delay"], known) if "delay" in said else None,
            ending=self._ending(name, skill, said),
            progress=self._progress(said["progress"], running | {"t", "f"}) if "progress" in said else None,
            outputs=self._outputs(name, skill, said["outputs"], running) if "outputs" in said else None,
            changes=tuple(self._change(change, running) for change in said["then"].elements()) if "then" in said else None,
            moves=self._moves(said["moves"], known) if "moves" in said else None,
            source=part.place,
        )

    def _ending(self, name: str, skill: Skill, said: Mapping[str, Located]) -> Ending | None:
        given = [key for key in ENDINGS if key in said]
        if len(given) > 1:
            raise said[given[1]].wrong(f"{name} can't have both `{given[0]}` and `{given[1]}` in one rule")
        message = said["message"].text("`message`") if "message" in said else ""
        if message and given != ["result"]:
            raise said["message"].wrong("`message` goes with a `result`; a refusal and a crash are messages themselves")
        if not given:
            return None
        entry = said[given[0]]
        if given == ["result"]:
            return Ending(results=self._results(name, skill, entry), message=message)
        if given == ["never"]:
            if entry.value is not True:
                raise entry.wrong("write `never: true`, or leave it out")
            return NEVER
        reason = entry.text(f"`{given[0]}`")
        if not reason:
            raise entry.wrong(f"`{given[0]}` is the reason of the refusal or crash; it should not be empty")
        return Ending(refuse=reason) if given == ["refuse"] else Ending(crash=reason)

    def _results(self, name: str, skill: Skill, entry: Located) -> tuple[tuple[str, float], ...]:
        weights = (
            {result: (weight, weight.number(f"the weight of {result}", 0.0)) for result, weight in entry.entries("`result`").items()}
            if entry.is_mapping
            else {entry.text("`result`"): (entry, 1.0)}
        )
        for result, (part, _) in weights.items():
            self._one(result, {known.name: known for known in skill.results}, part, name, "result")
        if not sum(weight for _, weight in weights.values()) > 0.0:
            raise entry.wrong("the weights of the results are all 0")
        return tuple((result, weight) for result, (_, weight) in weights.items())

    def _progress(self, part: Located, known: Collection[str]) -> Value | tuple[tuple[float, float], ...]:
        if not part.is_list:
            return self._value(part, known)
        points = [tuple(c.number("a point of the progress", 0.0, 1.0) for c in point.elements()) for point in part.elements()]
        in_order = all(before[0] <= after[0] for before, after in itertools.pairwise(points))
        if not points or any(len(point) != 2 for point in points) or not in_order:
            raise part.wrong("`progress` is a formula, or points [part of the delay, progress] in the order of the parts: [[0, 0], [1, 1]]")
        return tuple((point[0], point[1]) for point in points)

    def _outputs(self, name: str, skill: Skill, part: Located, known: Collection[str]) -> dict[str, Value]:
        types = {output.name: output.type for output in skill.outputs}
        values: dict[str, Value] = {}
        for output, entry in part.entries("`outputs`").items():
            kind = self._one(output, types, entry, name, "output")
            values[output] = entry.text(output) if kind == "string" else self._value(entry, known)
        return values

    def _moves(self, part: Located, known: Collection[str]) -> dict[str, Value]:
        values = {}
        for name, entry in part.entries("`moves`").items():
            self._one(name, dict.fromkeys(self._memory), entry, "the mock", "memory")
            values[name] = self._value(entry, known)
        return values

    # --- the clock ---------------------------------------------------------------------------------------------------

    def _change(self, part: Located, known: Collection[str]) -> MockChange:
        said = part.record("a change", ("after", "set"))
        return MockChange(self._duration(self._needed(part, said, "after"), known), self._states(self._needed(part, said, "set")))

    def _timeline_event(self, part: Located) -> TimelineEvent:
        said = part.record("an entry of the timeline", ("after", "since", "set"))
        anchor = self._anchor(said["since"]) if "since" in said else None
        after = self._duration(self._needed(part, said, "after"), self._memory)
        return TimelineEvent(after, self._states(self._needed(part, said, "set")), anchor, part.place)

    def _fault(self, name: str, part: Located) -> MockFault:
        said = part.record(f"the fault {name}", ("since", "delay", "set", "then", "ends"))
        anchor = self._anchor(said["since"]) if "since" in said else None
        delay = self._duration(said["delay"], self._memory) if "delay" in said else 0.0
        changes = tuple(self._change(change, self._memory) for change in said["then"].elements()) if "then" in said else ()
        ends = dict(self._ended(*entry) for entry in said["ends"].entries("`ends`").items()) if "ends" in said else {}
        states = {} if ends and "set" not in said else self._states(self._needed(part, said, "set"))
        return MockFault(states, delay, anchor, changes, ends, part.place)

    def _ended(self, name: str, part: Located) -> tuple[Place, str]:
        skillset, member = self._member(name, part, "skill")
        skill = self._one(member, {skill.name: skill for skill in skillset.skills}, part, f"skillset {skillset.name}", "skill")
        result = part.text("a result")
        self._one(result, {known.name: known for known in skill.results}, part, name, "result")
        return (skillset.name, member), result

    def _anchor(self, part: Located) -> tuple[Place, str]:
        words = part.text("`since`").split()
        if len(words) != 2:
            raise part.wrong(f"`since` is `{part.text('since')}`; write a resource and a state, as `base.base_status DRIVING`")
        return self._resource(words[0], words[1], part)

    def _states(self, part: Located) -> dict[Place, str]:
        found = {}
        for name, entry in part.entries("`set`").items():
            place, state = self._resource(name, entry.text(name), entry)
            resource = self._skillsets[place[0]].resource(place[1])
            if not any(transition.extern and transition.target == state for transition in resource.transitions):
                targets = ", ".join(dict.fromkeys(transition.target for transition in resource.transitions if transition.extern)) or "none"
                raise entry.wrong(f"{name} has no extern transition to {state}; there are some to {targets}")
            found[place] = state
        return found

    def _resource(self, name: str, state: str, part: Located) -> tuple[Place, str]:
        skillset, member = self._member(name, part, "resource")
        resource = self._one(member, {r.name: r for r in skillset.resources}, part, f"skillset {skillset.name}", "resource")
        self._one(state, dict.fromkeys(resource.states), part, f"resource {name}", "state")
        return (skillset.name, member), state

    # --- data --------------------------------------------------------------------------------------------------------

    def _data(self, name: str, part: Located) -> tuple[Place, DataScript]:
        skillset, member = self._member(name, part, "data")
        data = self._one(member, {data.name: data for data in skillset.data}, part, f"skillset {skillset.name}", "data")
        said = part.record(f"the data {name}", ("period", "value", "values"))
        if ("value" in said) == ("values" in said):
            raise part.wrong(f"{name} needs either `value` or `values`")
        resources = {resource.name: resource.states for resource in skillset.resources}
        known = {*self._memory, "t", *resources}
        period_s = said["period"].number("`period`", 0.001) if "period" in said else data.period_s or DEFAULT_PERIOD_S
        steps = (
            ((0.0, self._filled(said["value"], known, resources)),)
            if "value" in said
            else self._steps(name, said["values"], known, resources)
        )
        return (skillset.name, member), DataScript(period_s, steps, part.place)

    def _steps(self, name: str, part: Located, known: Collection[str], resources: States) -> tuple[tuple[float, object], ...]:
        steps = []
        for key, entry in part.entries(f"`values` of {name}").items():
            try:
                from_s = float(key)
            except ValueError:
                raise entry.wrong(f"`values` of {name}: `{key}` should be seconds since the start, as in {{0: 1.0, 10: null}}") from None
            steps.append((from_s, None if entry.value is None else self._filled(entry, known, resources)))
        return tuple(sorted(steps, key=lambda step: step[0]))

    def _filled(self, part: Located, known: Collection[str], resources: States) -> object:
        """Read a value that may be a message: a mapping of its fields."""
        if part.is_mapping:
            return {name: self._filled(entry, known, resources) for name, entry in part.entries("a message").items()}
        if part.is_list:
            return [self._filled(entry, known, resources) for entry in part.elements()]
        return self._value(part, known, resources)

    # --- parts -------------------------------------------------------------------------------------------------------

    def _value(self, part: Located, known: Collection[str], resources: States = NO_RESOURCES) -> Value:
        """Read a number, true or false, or a formula of known names."""
        value = part.value
        if isinstance(value, bool | int | float):
            return value
        try:
            formula = Formula(part.text("a value"), resources)
        except FormulaError as error:
            raise part.wrong(str(error)) from None
        for name in sorted(formula.names):
            if name not in known:
                raise part.wrong(f"`{formula.text}`: {name} is not known; there are {choices(name, sorted(known))}")
        return formula

    def _duration(self, part: Located, known: Collection[str]) -> Value:
        value = self._value(part, known)
        if isinstance(value, bool) or (isinstance(value, int | float) and not 0.0 <= value < float("inf")):
            raise part.wrong(f"a time is a number of seconds from 0 on, or a formula for one, not {part.value!r}")
        return value

    def _member(self, name: str, part: Located, what: str) -> tuple[Skillset, str]:
        skillset, dot, member = name.partition(".")
        if not dot:
            raise part.wrong(f"`{name}` should name skillset and {what}, as `navigation.{name}`")
        return self._one(skillset, self._skillsets, part, "the robot", "skillset"), member

    @staticmethod
    def _needed(part: Located, said: Mapping[str, Located], name: str) -> Located:
        if name not in said:
            raise part.wrong(f"`{name}` is missing")
        return said[name]

    @staticmethod
    def _one(name: str, known: Mapping[str, T], part: Located, whose: str, what: str) -> T:
        if name in known:
            return known[name]
        raise part.wrong(f"{whose} has no {what} {name}; it has {choices(name, known)}")


__all__ = ["BehaviourError", "load_behaviour"]
