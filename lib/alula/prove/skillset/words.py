"""Format the steps of a counterexample: what was done, what it changed, what it ended, what failed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from alula.language.counterexamples import Path, StepKind, Value
from alula.model.execution_state import ExecutionState
from alula.model.situation import Change, Entered, Running, Step
from alula.prove.skillset.steps import Key, Move

Name = Callable[[Running], str]
"""How an execution is called: ``goto``, or ``goto (execution 2)`` where several run."""


def told(move: Move, step: Step | None, name: Name, acting: str) -> str:
    """Return one step in words; ``step`` is None where it was refused, ``acting`` calls the execution that it is about."""
    if step is None:
        return "; ".join([_opening(move, acting), *(_FAULTS[fault[0]].format(what=_what(fault)) for fault in _failed(move))])
    own = _own_end(move, step)
    if own is not None and own.state is ExecutionState.FAILED:
        return _failure(move, step, name, acting)
    return _opening(move, acting) + listed(own_changes(step)) + violations(step, name)


def own_changes(step: Step) -> list[Change]:
    """Return the changes by the request itself: all before the first violation."""
    changes: list[Change] = []
    pending: list[Change] = []
    for happening in step.happenings:
        if isinstance(happening, Change):
            pending.append(happening)
        elif happening.state is ExecutionState.RESOURCE_INVARIANT_VIOLATED:
            return changes + [change for change in pending if not _is_by(change, happening.execution)]
        else:
            changes += pending
            pending = []
    return [*changes, *pending]


def violations(step: Step, name: Name) -> str:
    """Return the violations of a step in words, each with a semicolon before it."""
    words: list[str] = []
    pending: list[Change] = []
    for happening in step.happenings:
        if isinstance(happening, Change):
            pending.append(happening)
            continue
        if happening.state is ExecutionState.RESOURCE_INVARIANT_VIOLATED:
            own = [change for change in pending if _is_by(change, happening.execution)]
            words.append(f"`{happening.result}` of {name(happening.execution)} is false and ends it{listed(own)}")
            if happening.effect_failed:
                words.append(f"the effect of `{happening.result}` of {happening.execution.skill} is no transition from here")
        pending = []
    return "".join(f"; {word}" for word in words)


def data_text(values: Mapping[Path, Value]) -> str:
    """Return values of data in words: ``data battery.level == 0.1, on == true``."""
    return "data " + ", ".join(f"{'.'.join(path)} == {_value(value)}" for path, value in sorted(values.items()))


def broken(move: Move, step: Step, name: Name) -> str:
    """Return in words that data or time break an invariant, where no values are shown."""
    first = next(one for one in step.happenings if isinstance(one, Entered))
    own = [one for one in step.happenings if isinstance(one, Change) and _is_by(one, first.execution)]
    rest = Step(step.situation, step.happenings[step.happenings.index(first) + 1 :])
    failed = f"; the effect of `{move.subject[1]}` of {move.subject[0]} is no transition from here" if first.effect_failed else ""
    return f"data or time break `{move.subject[1]}` of {name(first.execution)}{listed(own)}{failed}{violations(rest, name)}"


def listed(changes: Sequence[Change]) -> str:
    """Return changes with a colon before them, or nothing."""
    return ": " + ", ".join(f"{c.resource} {c.source} -> {c.target}" for c in changes) if changes else ""


def _opening(move: Move, acting: str) -> str:
    match move.kind:
        case StepKind.EXTERN:
            return "the functional layer"
        case StepKind.OUTSIDE:
            return "from outside"
        case StepKind.EVENT:
            return f"event {move.subject[0]}"
        case StepKind.START:
            return f"{acting} {'starts' if move.step is not None else 'is asked for, and its preconditions are true'}"
        case StepKind.RESULT:
            return f"{acting} ends with {move.subject[1]}"
        case _:
            return f"{acting} is interrupted"


def _failure(move: Move, step: Step, name: Name, acting: str) -> str:
    """Return in words an end that comes out as FAILED; what it changes are the changes of another effect than the one asked for."""
    changes = listed(own_changes(step))
    why = "; ".join(_FAULTS[fault[0]].format(what=_what(fault)) for fault in _failed(move)[:1])
    if any(fault[0] == "post" for fault in move.faults):
        return f"{_opening(move, acting)}{changes}; {why}, so it ends as FAILED{violations(step, name)}"
    given_back = f" with the effect of its interruption{changes}" if changes else ""
    return f"{_opening(move, acting)}; {why}, so it ends as FAILED{given_back}{violations(step, name)}"


def _own_end(move: Move, step: Step) -> Entered | None:
    """Return how the execution entered its next state that a request is about."""
    if move.kind not in {StepKind.RESULT, StepKind.INTERRUPT}:
        return None
    return next((one for one in step.happenings if isinstance(one, Entered)), None)


def _failed(move: Move) -> list[Key]:
    return [fault for fault in move.faults if fault[0] in _FAULTS]


def _is_by(change: Change, execution: Running) -> bool:
    return change.cause.startswith(f"{execution.skill} {execution.id} ")


def _value(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _what(fault: Key) -> str:
    kind, *names = fault[1:]
    match kind:
        case "event":
            return f"event {names[0]}"
        case "start":
            return f"the start of {names[0]}"
        case "interrupt":
            return f"the interruption of {names[0]}"
        case _:
            return f"`{names[1]}` of {names[0]}"


def changes_of(happenings: Iterable[Change | Entered]) -> list[Change]:
    """Return the changes among what happened."""
    return [one for one in happenings if isinstance(one, Change)]


_FAULTS = {
    "effect": "the effect of {what} is no transition from here",
    "post": "the postcondition of {what} is false now",
}
