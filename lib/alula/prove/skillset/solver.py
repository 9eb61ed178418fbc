"""The model's conditions in z3: resources are enumerations, numbers of data are reals, or integers in the range of their type."""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import z3

from alula.model.expressions import And, Comparison, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, SkillRuns
from alula.model.model import Effect, Skillset
from alula.model.ros_types import INTEGER_RANGES
from alula.model.transitions import origins, targets_of
from alula.model.units import UNIT_IN_SI
from alula.prove.limits import Deadline, OutOfTimeError

Assignment = Mapping[str, str]


class Solver:
    """Translates the conditions of one skillset to z3, and decides them. States after an effect are constants in the condition."""

    def __init__(self, skillset: Skillset, deadline: Deadline) -> None:
        self.skillset = skillset
        self._deadline = deadline
        self._context = z3.Context()
        self._solver = z3.Solver(ctx=self._context)
        self._resources = {resource.name: resource for resource in skillset.resources}
        self._variables: dict[str, Any] = {}
        self._values: dict[str, dict[str, Any]] = {}
        self._texts: dict[str, int] = {}
        self._types = {data.name: data.type for data in skillset.data}
        self._numbers: dict[str, Any] = {}
        self._ranges: list[Any] = []
        """What is true of every number of an integer type."""
        for resource in skillset.resources:
            # An enumeration needs no bounds, so that a question costs what it asks and not what the skillset has.
            sort, values = z3.EnumSort(f"resource {resource.name}", [f"{resource.name} {s}" for s in resource.states], ctx=self._context)
            self._variables[resource.name] = z3.Const(f"state {resource.name}", sort)
            self._values[resource.name] = dict(zip(resource.states, values, strict=True))

    # --- questions ------------------------------------------------------------------------------------------------

    def possible(self, *terms: Any) -> bool:
        """Return whether all terms can be true at once; raise OutOfTimeError."""
        self._solver.push()
        try:
            return self._check(self._solver, [*self._ranges, *terms])
        finally:
            self._solver.pop()

    def example(self, *terms: Any) -> Any | None:
        """Return a model in which all terms are true, or None when there is none; raise OutOfTimeError.

        The model hangs on the terms alone: z3's choice also hangs on what a context was asked before, and on when Python frees terms. So
        a context of its own is asked for it.
        """
        if not self.possible(*terms):
            return None
        alone = z3.Context()
        solver = z3.Solver(ctx=alone)
        self._check(solver, [term.translate(alone) for term in (*self._ranges, *terms)])
        return solver.model().translate(self._context)

    def _check(self, solver: Any, terms: Sequence[Any]) -> bool:
        self._deadline.check()
        solver.set("timeout", max(1, int(self._deadline.left_s() * 1000)))
        solver.add(*terms)
        answer = solver.check()
        if answer == z3.unknown:
            raise OutOfTimeError
        return bool(answer == z3.sat)

    # --- terms ----------------------------------------------------------------------------------------------------

    def term(self, condition: Expression, after: Assignment | None = None) -> Any:
        """Return a condition as a term of z3; ``after`` gives resources the states after an effect."""
        match condition:
            case ResourceIs(resource=name, state=state, negated=negated):
                if after and name in after:
                    return self.constant(value=(after[name] == state) != negated)
                same = self.state_is(name, state)
                return z3.Not(same, ctx=self._context) if negated else same
            case DataIs():
                return self._data(condition)
            case SkillRuns(skill=skill):
                return z3.Bool(f"running {skill}", self._context)
            case Constant(value=value):
                return self.constant(value=value)
            case Not(operand=operand):
                return z3.Not(self.term(operand, after), ctx=self._context)
            case And(operands=operands):
                return z3.And(*(self.term(operand, after) for operand in operands))
            case Or(operands=operands):
                return z3.Or(*(self.term(operand, after) for operand in operands))
            case Implies(premise=premise, conclusion=conclusion):
                return z3.Implies(self.term(premise, after), self.term(conclusion, after))

    def constant(self, *, value: bool) -> Any:
        """Return the term of a truth value."""
        return z3.BoolVal(value, ctx=self._context)

    def state_is(self, resource: str, state: str) -> Any:
        """Return the term that a resource is in a state."""
        value = self._values[resource].get(state)
        return self.constant(value=False) if value is None else self._variables[resource] == value

    def negation(self, term: Any) -> Any:
        """Return the negation of a term."""
        return z3.Not(term, ctx=self._context)

    def applies(self, effect: Effect, *, by_event: bool = False) -> Any:
        """Return the term that every change of an effect is possible now."""
        possible = [
            z3.Or(
                self.constant(value=False), *(self.state_is(name, source) for source in origins(resource, targets, any_transition=by_event))
            )
            for name, targets in targets_of(effect).items()
            for resource in [self._resources[name]]
        ]
        return z3.And(self.constant(value=True), *possible)

    def _data(self, atom: DataIs) -> Any:
        name = ".".join(("data", atom.data, *atom.path))
        compare = _COMPARE[atom.comparison]
        if isinstance(atom.value, bool):
            return compare(z3.Bool(name, self._context), z3.BoolVal(atom.value, self._context))
        if isinstance(atom.value, str):
            # Texts are only compared for being the same: numbers in place of them will do.
            number = self._texts.setdefault(atom.value, len(self._texts))
            return compare(z3.Int(f"{name} text", self._context), z3.IntVal(number, self._context))
        # By its decimals: 20 % is to be shown as 0.2 and not as the float next to it.
        value = Fraction(repr(float(atom.value))) * Fraction(repr(UNIT_IN_SI.get(atom.unit, 1.0)))
        return compare(self._number(atom, name), z3.RealVal(str(value), self._context))

    def _number(self, atom: DataIs, name: str) -> Any:
        """Return the variable of a number: an integer in its range where the data itself is one, else a real."""
        if name not in self._numbers:
            bounds = None if atom.path else INTEGER_RANGES.get(self._types.get(atom.data, ""))
            if bounds is None:
                self._numbers[name] = z3.Real(f"{name} number", self._context)
            else:
                whole = z3.Int(f"{name} number", self._context)
                self._ranges += [whole >= bounds[0], whole <= bounds[1]]
                self._numbers[name] = z3.ToReal(whole)
        return self._numbers[name]

    # --- answers --------------------------------------------------------------------------------------------------

    def told(self, model: Any, resources: Sequence[str], data: Collection[str]) -> tuple[str, ...]:
        """Return the states of these resources and the values of these data in a model, one line each."""
        lines = [f"{name} == {self._state(model, name)}" for name in resources]
        return (*lines, *self._told_data(model, data))

    def data_values(self, model: Any) -> dict[tuple[str, ...], float | str | bool]:
        """Return the value of each data, by its name and field, that the model gives one; numbers in SI units."""
        texts = {number: text for text, number in self._texts.items()}
        found: dict[tuple[str, ...], float | str | bool] = {}
        for declared in model.decls():
            words = declared.name().split(" ")
            if not words[0].startswith("data."):
                continue
            path, value = tuple(words[0].split(".")[1:]), model[declared]
            if words[-1] == "text":
                found[path] = texts.get(value.as_long(), "another text")
            elif words[-1] == "number":
                found[path] = float(value.as_fraction() if hasattr(value, "as_fraction") else value.as_long())
            else:
                found[path] = bool(z3.is_true(value))
        return found

    def _state(self, model: Any, name: str) -> str:
        value: str = model.eval(self._variables[name], model_completion=True).decl().name()
        return value.removeprefix(f"{name} ")

    def _told_data(self, model: Any, data: Collection[str]) -> Iterator[str]:
        texts = {number: text for text, number in self._texts.items()}
        for declared in sorted(model.decls(), key=str):
            words = declared.name().split(" ")
            name = words[0].removeprefix("data.")
            if not words[0].startswith("data.") or name.split(".")[0] not in data:
                continue
            value = model[declared]
            if words[-1] == "text":
                text = texts.get(value.as_long())
                yield f'{name} == "{text}"' if text is not None else f"{name} is another text"
            elif words[-1] == "number":
                yield f"{name} == {value.as_decimal(6).rstrip('?') if hasattr(value, 'as_decimal') else value.as_long()}"
            else:
                yield f"{name} == {str(value).lower()}"


_COMPARE: Mapping[Comparison, Callable[[Any, Any], Any]] = {
    Comparison.EQ: operator.eq,
    Comparison.NE: operator.ne,
    Comparison.LT: operator.lt,
    Comparison.LE: operator.le,
    Comparison.GT: operator.gt,
    Comparison.GE: operator.ge,
}
