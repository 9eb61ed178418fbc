"""Mocks fitted from a record: what a skill did with the same inputs it does again, as long as it took and with the same result."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from alula.mock import Behaviour, Ending, Rule
from alula.model.execution_state import ExecutionState
from alula.records.replay.comparison import alike
from alula.records.replay.recorded import Recorded, RecordedEnd


def fitted(recorded: Recorded) -> Behaviour:
    """Return the mock rules of a record; of several outcomes for the same inputs the last one counts."""
    rules: dict[tuple[str, str], list[Rule]] = defaultdict(list)
    for answer in reversed(list(recorded.answers.values())):
        if answer.state is ExecutionState.TERMINATED and answer.duration_s is not None:
            rules[answer.skillset, answer.skill].append(_rule(answer, answer.duration_s))
    return Behaviour(rules={place: tuple(found) for place, found in rules.items()})


def _rule(answer: RecordedEnd, duration_s: float) -> Rule:
    inputs = dict(answer.inputs)

    def same(names: Mapping[str, Any]) -> bool:
        return all(alike(_plain(names.get(name)), value) for name, value in inputs.items())

    ending = Ending(results=((answer.result, 1.0),), message=answer.message)
    return Rule(when=same if inputs else None, delay=duration_s, ending=ending, outputs=dict(answer.outputs) or None)


def _plain(value: Any) -> Any:
    return dict(vars(value)) if hasattr(value, "__dict__") else value
