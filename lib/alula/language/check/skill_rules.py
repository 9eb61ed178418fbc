"""Rules about one skill: its names, what its conditions and effects lead to, and the names that generated code needs."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from alula.language import reserved_names
from alula.language.check.references import (
    Named,
    condition_findings,
    duplicates,
    effect_findings,
    error,
    for_generator,
    last_word,
    names_of_types,
    ros_name,
    unit_findings,
    warning,
)
from alula.language.errors import Diagnostic
from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import TRUE, And, Comparison, DataIs, Expression, Implies, Not, Or, ResourceIs, atoms
from alula.model.model import NO_EFFECT, Effect, Hold, Invariant, Skill, Skillset
from alula.model.ros_types import camel
from alula.model.units import UNIT_IN_SI


def _skill_names(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    yield from duplicates("effect", skill.effects)
    yield from duplicates("precondition", skill.preconditions)
    yield from duplicates("invariant", skill.invariants)
    yield from duplicates("result", skill.results)
    yield from duplicates("parameter", skill.parameters)
    yield from duplicates("input", skill.inputs)
    yield from duplicates("output", skill.outputs)
    yield from duplicates("role", skill.provides)
    yield from duplicates("role", skill.needs)
    named: tuple[Named, ...] = (*skill.preconditions, *skill.invariants, *skill.results, *skill.parameters, *skill.inputs, *skill.outputs)
    yield from names_of_types(skillset, named)
    shared = {resource.name: "resource" for resource in skillset.resources} | {data.name: "data" for data in skillset.data}
    for parameter in (*skill.inputs, *skill.outputs):
        if parameter.name in shared:
            message = f"`{parameter.name}` of `{skill.name}` has the name of a {shared[parameter.name]}, and hides it from no condition"
            yield warning("ALU304", message, parameter.span, hint="conditions speak of resources and data, never of inputs")


def _interface_names(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", skill.name) or keyword.iskeyword(camel(skill.name)):
        hint = "a skill's name begins with a letter, has single _ between letters and digits, and is not None, True or False"
        yield for_generator("ALU216", f"skill `{skill.name}` can't be the name of a ROS action", skill.span, hint=hint)
    for parameter in (*skill.inputs, *skill.outputs):
        yield from ros_name("field", parameter)
    for output in skill.outputs:
        if output.name in reserved_names.OUTPUTS:
            message = f"generated code needs the name `{output.name}` for itself; name the output otherwise"
            yield for_generator("ALU215", message, output.span)
    for given in skill.inputs:
        if given.name in reserved_names.INPUTS:
            yield for_generator("ALU215", f"generated code needs the name `{given.name}` for itself; name the input otherwise", given.span)


def _conditions(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    for precondition in skill.preconditions:
        yield from condition_findings(skillset, precondition.condition, f"precondition `{precondition.name}`", data_allowed=True)
    for invariant in skill.invariants:
        yield from condition_findings(skillset, invariant.condition, f"invariant `{invariant.name}`", data_allowed=True)
    yield from condition_findings(skillset, skill.interrupt.postcondition, "the interruption's postcondition", data_allowed=False)
    yield from condition_findings(skillset, skill.achieves, f"what `{skill.name}` achieves", data_allowed=True)
    for result in skill.results:
        yield from condition_findings(skillset, result.postcondition, f"the postcondition of `{result.name}`", data_allowed=False)


def _unheard(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    """Warn of conditions that hold after a silence, as unknown is none of the states that they exclude, and don't say so."""
    initial = {resource.name: resource.initial for resource in skillset.resources if resource.silence_s is not None}
    for kind, named in (("precondition", skill.preconditions), ("invariant", skill.invariants)):
        for one in named:
            said = {(atom.resource, atom.state) for atom in atoms(one.condition) if isinstance(atom, ResourceIs)}
            for name in dict.fromkeys(_excluded(one.condition, holds=True)):
                if name in initial and (name, initial[name]) not in said:
                    message = f"{kind} `{one.name}` holds while the reporter of `{name}` is silent and `{name}` is `{initial[name]}`"
                    hint = f"ask for the states that are good, or say `{name} == {initial[name]}` or `!= {initial[name]}` as well"
                    yield warning("ALU306", message, one.span, hint=hint)


def _excluded(condition: Expression, *, holds: bool) -> Iterator[str]:
    """Yield the resources of which a condition that ``holds`` (or, within a negation, does not) excludes a state."""
    match condition:
        case ResourceIs(resource=resource, negated=negated):
            if negated == holds:
                yield resource
        case Not(operand=operand):
            yield from _excluded(operand, holds=not holds)
        case And(operands=operands) | Or(operands=operands):
            for operand in operands:
                yield from _excluded(operand, holds=holds)
        case Implies(premise=premise, conclusion=conclusion):
            yield from _excluded(premise, holds=not holds)
            yield from _excluded(conclusion, holds=holds)
        case _:
            pass


def _holds(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    for invariant in skill.invariants:
        if invariant.hold is not None:
            yield from _hold(invariant, invariant.hold)
            yield from _short(skillset, invariant, invariant.hold)


def _hold(invariant: Invariant, hold: Hold) -> Iterator[Diagnostic]:
    if hold.for_s < 0 or (hold.for_s == 0 and hold.hysteresis is None):
        yield error("ALU221", f"invariant `{invariant.name}` holds for {hold.for_s:g} s; it must be positive", hold.span)
    if hold.hysteresis is None:
        return
    yield from unit_findings(hold.unit, last_word(hold.span, hold.unit))
    condition = invariant.condition
    below = {Comparison.LT: True, Comparison.LE: True, Comparison.GT: False, Comparison.GE: False}
    if not isinstance(condition, DataIs) or condition.comparison not in below or not isinstance(condition.value, float):
        message = f"invariant `{invariant.name}` can't recover at a value: its condition is no single comparison with a number"
        yield error("ALU221", message, hold.span, hint="`recovers at` goes with a condition such as `fps >= 10`")
        return
    scale, own_scale = UNIT_IN_SI.get(hold.unit or condition.unit, 1.0), UNIT_IN_SI.get(condition.unit, 1.0)
    recovers, broken = hold.hysteresis * scale, condition.value * own_scale
    if recovers >= broken if below[condition.comparison] else recovers <= broken:
        side = "below" if below[condition.comparison] else "above"
        message = f"invariant `{invariant.name}` recovers at a value that is not {side} its threshold"
        yield error("ALU221", message, hold.span, hint="it recovers where the condition holds with something to spare")


def _short(skillset: Skillset, invariant: Invariant, hold: Hold) -> Iterator[Diagnostic]:
    """Warn of a duration within which no second value of its data comes."""
    asked = {atom.data for atom in atoms(invariant.condition) if isinstance(atom, DataIs)}
    for data in skillset.data:
        if data.name in asked and data.period_s is not None and 0 < hold.for_s < data.period_s:
            message = f"invariant `{invariant.name}` waits for {hold.for_s:g} s, and `{data.name}` comes every {data.period_s:g} s"
            yield warning("ALU305", message, hold.span, hint="within that time no better value can come: one bad value ends the skill")


def _effects(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    used = _used_effects(skill)
    defined = {effect.name for effect in skill.effects}
    for effect in (*skill.effects, *(e for e in used if e.name not in defined)):
        yield from effect_findings(skillset, effect, any_transition=False)
    names = {effect.name for effect in used}
    for effect in skill.effects:
        if effect.name not in names:
            yield warning("ALU301", f"effect `{effect.name}` of `{skill.name}` is never used", effect.span)


def _stops(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    timeout_s = skill.interrupt.timeout_s
    if timeout_s is not None and timeout_s <= 0:
        yield error("ALU221", f"a stop of `{skill.name}` may take {timeout_s:g} s; it must be positive", skill.interrupt.span)


def _ends(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    if not skill.results:
        hint = "add a result: `result { NAME }` in the paper's notation, `success NAME` in the Robot Language"
        yield for_generator("ALU218", f"skill `{skill.name}` has no result", skill.span, hint=hint)


def _achievements(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    span = next((atom.span for atom in atoms(skill.achieves)), skill.span)
    if skill.achieves != TRUE and skill.results and not skill.successes:
        message = f"`{skill.name}` achieves something with its success, and has none"
        yield error("ALU227", message, span, hint="what is so while it runs is a role: `provides name`")
    for result in skill.successes:
        states = {one.resource: one.target for one in result.effect.assignments}
        if states and judge(skill.achieves, states, NO_DATA) is False:
            message = f"`{skill.name}` achieves what the effect of `{result.name}` undoes"
            yield error("ALU228", message, span, hint="effects say by themselves what they achieve: leave it out, or mend one of the two")


SKILL_RULES: Sequence[Callable[[Skillset, Skill], Iterable[Diagnostic]]] = (
    _skill_names,
    _interface_names,
    _conditions,
    _unheard,
    _holds,
    _effects,
    _ends,
    _stops,
    _achievements,
)


def _used_effects(skill: Skill) -> list[Effect]:
    used = [skill.start, skill.interrupt.effect]
    used += [invariant.effect for invariant in skill.invariants]
    used += [result.effect for result in skill.results]
    return [effect for effect in used if effect != NO_EFFECT]
