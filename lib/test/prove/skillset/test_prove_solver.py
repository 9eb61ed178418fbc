"""What z3 is asked for: the values that show a finding hang on the question alone."""

from __future__ import annotations

import random

import pytest

from alula.model.expressions import And, Comparison, DataIs, Expression, Implies, Not, Or
from alula.model.model import Data, Skillset
from alula.prove.limits import Deadline
from alula.prove.skillset.solver import Solver

MODEL = Skillset("any", data=(Data("d", "float64"), Data("e", "float64"), Data("n", "int32")))
ANY_TIME = Deadline.after(1e6)


def condition(chance: random.Random, depth: int) -> Expression:
    if not depth:
        return DataIs(chance.choice("den"), (), chance.choice(list(Comparison)), float(chance.randrange(-3, 4)))
    one, other = (condition(chance, depth - 1) for _ in range(2))
    return chance.choice((Not(one), And((one, other)), Or((one, other)), Implies(one, other)))


@pytest.mark.parametrize("seed", range(40))
def test_the_values_of_an_example_do_not_hang_on_what_was_asked_before(seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311 - for tests
    wish, *others = (condition(chance, 3) for _ in range(6))
    alone, asked_before = Solver(MODEL, ANY_TIME), Solver(MODEL, ANY_TIME)
    for solver in (alone, asked_before):  # the ranges of integers are the same in both
        solver.possible(solver.term(DataIs("n", (), Comparison.EQ, 0.0)))
    for other in others:
        asked_before.example(asked_before.term(other))
    found = [solver.example(solver.term(wish)) for solver in (alone, asked_before)]
    values = [model and solver.data_values(model) for solver, model in zip((alone, asked_before), found, strict=True)]
    assert values[0] == values[1]
