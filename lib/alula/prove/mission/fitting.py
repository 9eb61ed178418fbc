"""Values of data that fit what ticks have answered about them: for situations in which data stay as they are, and for plays."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, product
from types import SimpleNamespace

from alula.prove.mission.measured import DATA, FRESH, NUMBER, data_in
from alula.prove.mission.oracle import Answer, Asked, Question
from alula.trees.script.compiler import EPSILON

COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": lambda left, right: abs(left - right) <= EPSILON,
}
ANOTHER = "another"

Values = Mapping[str, object]
"""By the names of fields what is told; by those of data whether a value is fresh, where that was asked of them too."""


def fits(values: Values, question: Question, answer: Answer) -> bool:
    """Return whether values give this answer to a question about data."""
    _, name, symbol, other = question
    key = f"{name} {FRESH}" if symbol == FRESH else str(name)
    if symbol == FRESH or key not in values:
        return values.get(key, answer) == answer
    value = values[key]
    if symbol == NUMBER or value is None:
        return symbol == NUMBER and (value is not None) == answer
    known = value == str(other)[1:-1] if isinstance(value, str) else COMPARE[str(symbol)](float(str(value)), float(str(other)))
    return known == answer


def agree(values: Values, choices: Iterable[Asked]) -> bool:
    """Return whether values agree with all answers about data among the choices of a tick."""
    return all(fits(values, one.question, one.answer) for one in choices if one.question[0] == DATA)


def answers(values: Values, questions: Iterable[Question]) -> list[Asked]:
    """Return the answers that values give to questions about data; of data that is not fresh, or no number, that answer alone."""
    fresh = [one for one in questions if one[2] == FRESH or values.get(f"{data_in(str(one[1]))} {FRESH}", True)]
    known = [one for one in fresh if one[2] in {FRESH, NUMBER} or values.get(str(one[1])) is not None]
    return [Asked(one, (), fits(values, one, answer=True)) for one in known]


def all_values(questions: Iterable[Question]) -> Iterator[Values]:
    """Yield values for each combination of answers that questions about data can have."""
    asked: dict[str, list[Question]] = {}
    for question in questions:
        asked.setdefault(f"{question[1]} {FRESH}" if question[2] == FRESH else str(question[1]), []).append(question)
    ways = [list(_ways(several)) for several in asked.values()]
    for combined in product(*ways):
        yield dict(zip(asked, combined, strict=True))


def _ways(questions: Sequence[Question]) -> Iterator[object]:
    """Yield one value for each way to answer questions about one name."""
    if questions[0][2] == FRESH:
        yield from (True, False)
        return
    name = str(questions[0][1])
    seen: set[tuple[bool, ...]] = set()
    for value in _candidates(questions):
        answers = tuple(fits({name: value}, one, answer=True) for one in questions)
        if answers not in seen:
            seen.add(answers)
            yield value


def _candidates(questions: Sequence[Question]) -> Iterator[object]:
    others = [str(one[3]) for one in questions if one[2] != NUMBER]
    if others and others[0].startswith("'"):
        texts = {one[1:-1] for one in others}
        yield from sorted(texts)
        yield next(name for name in (ANOTHER, *(f"{ANOTHER} {number}" for number in range(len(texts)))) if name not in texts)
        return
    numbers = sorted({float(one) for one in others}) or [0.0]
    yield from numbers
    yield from ((low + high) / 2 for low, high in pairwise(numbers))
    yield numbers[-1] + 1.0  # before what is below: of what is true or false, no value is negative
    yield numbers[0] - 1.0
    yield from (one + away for one in numbers for away in (-EPSILON / 2, EPSILON / 2))
    if len(others) < len(questions):
        yield None


def told(choices: Sequence[Asked]) -> dict[str, object] | None:
    """Return values of ``skillset.data`` that fit the choices of a tick, None for one that is not fresh; None where no values fit."""
    found = next(
        (one for one in all_values(dict.fromkeys(one.question for one in choices)) if agree(one, choices)),
        None,
    )
    if found is None:
        return None
    said: dict[str, object] = {}
    for name, value in found.items():
        data, fresh, _ = name.partition(f" {FRESH}")
        if fresh and not value:
            said[data] = None
        elif not fresh:
            path = name.split(".")[2:]
            value = math.nan if value is None else value  # noqa: PLW2901
            if not path:
                said[name] = value
                continue
            place = said.setdefault(data_in(name), SimpleNamespace())
            for part in path[:-1]:
                place = vars(place).setdefault(part, SimpleNamespace())
            setattr(place, path[-1], value)
        else:
            said.setdefault(data, SimpleNamespace())
    return said
