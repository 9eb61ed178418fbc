"""Mocks fitted from a record: what a skill did with the same inputs it does again, as long as it took and with the same result.

Extern transitions are the record's. Resources that it never mentions are as mocks have them once the robot is ready: the model has got them
since, or they have not changed while the mission ran.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from alula.common.record import EVENTS
from alula.mock import Behaviour, Ending, Rule
from alula.model.execution_state import ExecutionState
from alula.records.replay.comparison import alike
from alula.records.replay.recorded import Recorded, RecordedExecution


def fitted(recorded: Recorded) -> Behaviour:
    """Return the mock rules of a record; of several outcomes for the same inputs the last one counts."""
    rules: dict[tuple[str, str], list[Rule]] = defaultdict(list)
    for execution in reversed(list(recorded.executions.values())):
        if execution.state is ExecutionState.TERMINATED and execution.duration_s is not None:
            rules[execution.skillset, execution.skill].append(_rule(execution, execution.duration_s))
    return Behaviour(rules={place: tuple(found) for place, found in rules.items()})


def with_untold(recorded: Recorded, behaviour: Behaviour) -> Behaviour:
    """Return the behaviour for a replay: of its timeline only what no event of the record is about, at once at the beginning.

    Nothing is left of it where the mission has decided nothing: then it may be just that which was not told.
    """
    events = [entry.value for entry in recorded.entries if entry.topic == EVENTS]
    told = {(event.get("skillset"), event.get("resource")) for event in events}

    def of(one: Behaviour) -> Behaviour:
        states = [{place: state for place, state in event.states.items() if place not in told} for event in one.timeline]
        events = [replace(event, after_s=0.0, states=left) for event, left in zip(one.timeline, states, strict=True)]
        timeline = tuple(event for event in events if event.states and event.anchor is None) if recorded.decisions else ()
        return replace(one, timeline=timeline, beside=tuple(map(of, one.beside)))

    return of(behaviour)


def _rule(execution: RecordedExecution, duration_s: float) -> Rule:
    inputs = dict(execution.inputs)

    def same(names: Mapping[str, Any]) -> bool:
        return all(alike(_plain(names.get(name)), value) for name, value in inputs.items())

    ending = Ending(results=((execution.result, 1.0),), message=execution.message)
    return Rule(when=same if inputs else None, delay=duration_s, ending=ending, outputs=dict(execution.outputs) or None)


def _plain(value: Any) -> Any:
    return dict(vars(value)) if hasattr(value, "__dict__") else value
