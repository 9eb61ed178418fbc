"""Writes expectations from a run, for a person to edit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from alula.model.execution_state import ExecutionState
from alula.records.expectations.checking import starts_or_ends, states_at, told
from alula.records.expectations.values import TOLERANCE_S
from alula.records.run import RecordedRun
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent

TOGETHER_S = 0.05
"""Events of several skillsets that are no farther apart may come in any order."""
REST_S = 4 * TOLERANCE_S
"""States are asked in the middle of times in which no resource changes for as long as this."""


def expectations_of(run: RecordedRun) -> str:
    """Return a YAML text that the run fulfils."""
    lines = [
        f"# What {run.path.name} was. Times are seconds of mission clock after the departure.",
        *([f"outcome: {run.outcome}"] if run.outcome else []),
        f"tolerance_s: {TOLERANCE_S:g}",
        "",
        "# Starts and ends of skills, one after another; those of a list within the list in any order.",
        "order:",
        *(_group(group, run) for group in _groups(run)),
        "complete: true     # no other skill starts or ends",
        "",
        *_states(run),
        "never:",
        *(f'  - "* {state}"' for state in _unseen(run)),
    ]
    return "\n".join(lines) + "\n"


def _groups(run: RecordedRun) -> list[list[EngineEvent]]:
    """Return what comes one after another; what is near and of several skillsets is together, as a list has one order or none."""
    near: list[list[EngineEvent]] = []
    for event in filter(starts_or_ends, run.events):
        if near and event.stamp_s - near[-1][0].stamp_s <= TOGETHER_S:
            near[-1].append(event)
        else:
            near.append([event])
    several = [len({event.skillset for event in group}) > 1 for group in near]
    return [part for group, any_order in zip(near, several, strict=True) for part in ([group] if any_order else [[one] for one in group])]


def _moment(event: EngineEvent, run: RecordedRun) -> str:
    return f"{{what: {told(event)}, at_s: {run.time_s(event):.2f}}}"


def _group(group: Sequence[EngineEvent], run: RecordedRun) -> str:
    moments = [_moment(event, run) for event in group]
    return f"  - {moments[0]}" if len(moments) == 1 else f"  - [{', '.join(moments)}]"


def _states(run: RecordedRun) -> Iterator[str]:
    """Yield what each resource that has changed is in, in times of rest."""
    stamps = [event.stamp_s for event in run.events if isinstance(event, TransitionEvent)]
    rests = [(before + after) / 2 for before, after in pairwise(stamps) if after - before >= REST_S]
    told_of: dict[str, str] = {}
    lines = []
    for at_s in rests:
        states = {name: change.to_state for name, change in states_at(run.events, at_s).items()}
        fresh = {name: state for name, state in states.items() if told_of.get(name) != state}
        told_of = states
        if fresh:
            lines.append(f"  - {{at_s: {at_s - run.origin_s:.2f}, {', '.join(f'{name}: {state}' for name, state in fresh.items())}}}")
    if lines:
        yield from ("states:", *lines, "")


def _unseen(run: RecordedRun) -> Iterator[str]:
    """Yield the ends that no execution had."""
    seen = {event.state for event in run.events if isinstance(event, ExecutionEvent)}
    yield from (state.value for state in ExecutionState if state.terminal and state not in seen)
