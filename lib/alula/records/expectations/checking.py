"""Holds a run against expectations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.model.execution_state import ExecutionState
from alula.records.expectations.values import Expectations, ExpectedMoment, Never, States
from alula.records.run import RecordedRun
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent


@dataclass(frozen=True)
class Checked:
    """An expectation: its place in the file, what was expected, and how the run differs, with the place there; empty: it does not."""

    place: str
    expected: str
    problem: str = ""

    def __str__(self) -> str:
        return f"{self.place}: {self.expected}: {self.problem or 'as expected'}"


def check(expectations: Expectations, run: RecordedRun) -> list[Checked]:
    """Return what became of each expectation, in the order of the file."""
    return [
        *_outcome(expectations, run),
        *_order(expectations, run),
        *(_states(one, run) for one in expectations.states),
        *(_never(one, run) for one in expectations.never),
    ]


def place_of(event: EngineEvent, run: RecordedRun) -> str:
    """Name an event of a run."""
    return f"{event.skillset} event {event.sequence} at {run.time_s(event):.3f} s"


def _outcome(expectations: Expectations, run: RecordedRun) -> Iterator[Checked]:
    if expectations.outcomes:
        found = run.outcome or "not known"
        problem = "" if found in expectations.outcomes else f"{run.path}: it is {found}"
        yield Checked(expectations.outcome_place, f"outcome {' or '.join(expectations.outcomes)}", problem)


# --- order --------------------------------------------------------------------------------------------------------------


def _order(expectations: Expectations, run: RecordedRun) -> Iterator[Checked]:
    """Search each group after the one before; a missing event does not move the search on, so that each is reported by itself."""
    matched: set[int] = set()
    since = -1
    for group in expectations.order:
        found = [_find(moment, run, since, matched) for moment in group]
        yield from (_checked(moment, at, run, since) for moment, at in zip(group, found, strict=True))
        since = max([since, *(at for at in found if at is not None)])
    if expectations.complete:
        yield _complete(expectations.complete_place, run, matched)


def _find(moment: ExpectedMoment, run: RecordedRun, since: int, matched: set[int]) -> int | None:
    """Return the first event behind ``since`` that is meant and not taken, and take it."""
    for at, event in enumerate(run.events):
        if at > since and at not in matched and moment.pattern.fits(event) and _in_time(moment, run.time_s(event)):
            matched.add(at)
            return at
    return None


def _in_time(moment: ExpectedMoment, time_s: float) -> bool:
    return moment.at_s is None or abs(time_s - moment.at_s) <= moment.tolerance_s


def _checked(moment: ExpectedMoment, at: int | None, run: RecordedRun, since: int) -> Checked:
    when = "" if moment.at_s is None else f" at {moment.at_s:g} s, give or take {moment.tolerance_s:g} s"
    expected = f"{moment.pattern}{when}"
    return Checked(moment.place, expected, "" if at is not None else _missing(moment, run, since))


def _missing(moment: ExpectedMoment, run: RecordedRun, since: int) -> str:
    """Say where else the run has what was expected."""
    behind = f" after {place_of(run.events[since], run)}" if since >= 0 else ""
    meant = [(at, event) for at, event in enumerate(run.events) if moment.pattern.fits(event)]
    later = [event for at, event in meant if at > since]
    if not meant:
        return f"{run.path}: it never happens"
    if not later:
        return f"{run.path}: it does not happen{behind}; the last one is {place_of(meant[-1][1], run)}"
    if moment.at_s is None:
        return f"{run.path}: it does not happen once more{behind}"
    wanted_s = moment.at_s
    nearest = min(later, key=lambda event: abs(run.time_s(event) - wanted_s))
    return f"{run.path}: it is {place_of(nearest, run)}, {run.time_s(nearest) - wanted_s:+.3f} s off"


def _complete(place: str, run: RecordedRun, matched: set[int]) -> Checked:
    others = [event for at, event in enumerate(run.events) if at not in matched and starts_or_ends(event)]
    problem = ""
    if others:
        first = others[0]
        more = f", and {len(others) - 1} more" if len(others) > 1 else ""
        problem = f"{run.path}: {told(first)} besides ({place_of(first, run)}){more}"
    return Checked(place, "no skill starts or ends besides", problem)


def starts_or_ends(event: EngineEvent) -> bool:
    """Return whether an execution began to run, or ended."""
    return isinstance(event, ExecutionEvent) and (event.state is ExecutionState.RUNNING or event.state.terminal)


def told(event: EngineEvent) -> str:
    """Format an event in the notation of patterns."""
    if isinstance(event, TransitionEvent):
        return f"{event.skillset}.{event.resource} {event.to_state}"
    return f"{event.skillset}.{event.skill} {event.state.value} {event.result}".rstrip()


# --- states, and what must not be ---------------------------------------------------------------------------------------


def states_at(events: Sequence[EngineEvent], until_s: float) -> Mapping[str, TransitionEvent]:
    """Return the last transition of each resource (``skillset.resource``) up to a time of the mission clock."""
    changes = [event for event in events if isinstance(event, TransitionEvent) and event.stamp_s <= until_s]
    return {f"{event.skillset}.{event.resource}": event for event in changes}


def _states(states: States, run: RecordedRun) -> Checked:
    last = states_at(run.events, run.origin_s + states.at_s)
    first = {f"{e.skillset}.{e.resource}": e for e in reversed(run.events) if isinstance(e, TransitionEvent)}
    problems = []
    for name, wanted in states.resources:
        if name in last:
            state, since = last[name].to_state, f" since {place_of(last[name], run)}"
        elif name in first:
            state, since = first[name].from_state, " from the beginning"
        else:
            state, since = "never told of", ""
        if state != wanted:
            problems.append(f"{name} is {state}{since}")
    expected = ", ".join(f"{name} {state}" for name, state in states.resources)
    return Checked(states.place, f"{expected} at {states.at_s:g} s", f"{run.path}: {', '.join(problems)}" if problems else "")


def _never(never: Never, run: RecordedRun) -> Checked:
    expected, events = f"never {never.pattern}", list(run.events)
    if never.after is not None:
        expected += f" after {never.after}"
        begin = next((at for at, event in enumerate(events) if never.after.fits(event)), len(events))
        events = events[begin + 1 :]
    found = [event for event in events if never.pattern.fits(event)]
    problem = f"{run.path}: {told(found[0])} ({place_of(found[0], run)})" if found else ""
    return Checked(never.place, expected, problem)
