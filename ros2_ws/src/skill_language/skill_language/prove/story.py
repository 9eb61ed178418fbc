"""Tells a way through the situations so that people can follow it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from skill_language.prove.explore import Edge, Graph
from skill_language.prove.steps import Move, State, World
from skill_model.execution_state import ExecutionState
from skill_model.situation import Change


def story(graph: Graph, way: Sequence[Edge], last: Move | None = None) -> tuple[str, ...]:
    """Return a numbered line for the initial situation, one for each step, and one for a last step that shows a fault."""
    moves = [move_of(graph, edge) for edge in way]
    return walked(graph.world, graph.states[0], moves if last is None else [*moves, last])


def walked(world: World, first: State, moves: Iterable[Move]) -> tuple[str, ...]:
    """Return a numbered line for the initial situation and one for each step."""
    return numbered([f"initially {situation(world, first) or 'nothing runs'}", *map(told, moves)])


def to(graph: Graph, number: int, last: Move | None = None) -> tuple[str, ...]:
    """Return the story of a shortest way to a situation."""
    return story(graph, graph.path(number), last)


def numbered(lines: Iterable[str], first: int = 1) -> tuple[str, ...]:
    """Return lines with their numbers before them."""
    return tuple(f"{number}. {line}" for number, line in enumerate(lines, first))


def move_of(graph: Graph, edge: Edge) -> Move:
    """Take the step of an edge again, for its details."""
    target = graph.states[edge.target]
    for move in graph.world.moves(graph.states[edge.source]):
        if move.target == target and move.kind == edge.kind and move.subject == edge.subject and move.step is not None:
            return move
    raise LookupError(edge)


def situation(world: World, state: State) -> str:
    """Return a situation in words: ``motion == Off, goto running``."""
    names = [resource.name for resource in world.skillset.resources]
    words = [f"{name} == {value}" for name, value in zip(names, state.resources, strict=True)]
    return ", ".join([*words, *(f"{skill} running" for skill in state.running)])


def told(move: Move) -> str:
    """Return one step in words."""
    words = [f"{_opening(move)}{_changes(move)}"]
    if move.step is not None:
        words += _violations(move)
    words += [_FAULTS[fault[0]].format(what=_what(fault)) for fault in move.faults if fault[0] in _FAULTS]
    return "; ".join(words)


def _opening(move: Move) -> str:
    match move.kind:
        case "extern":
            return "the functional layer"
        case "event":
            return f"event {move.subject[0]}"
        case "start":
            verb = "starts" if move.step is not None else "is asked for, and its preconditions are true"
            return f"{move.subject[0]} {verb}"
        case "terminate":
            return f"{move.subject[0]} ends with {move.subject[1]}"
        case "interrupt":
            return f"{move.subject[0]} is interrupted"
        case _:
            return f"data or time break `{move.subject[1]}` of {move.subject[0]}"


def _changes(move: Move) -> str:
    """Return what the request itself changed: all before the first violation."""
    if move.step is None:
        return ""
    changes: list[Change] = []
    pending: list[Change] = []
    for happening in move.step.happenings:
        if isinstance(happening, Change):
            pending.append(happening)
        elif happening.state is ExecutionState.RESOURCE_INVARIANT_VIOLATED:
            by = f"{happening.execution.skill} {happening.execution.id} "
            changes += [change for change in pending if not change.cause.startswith(by)]
            return _listed(changes)
        else:
            changes += pending
            pending = []
    return _listed([*changes, *pending])


def _violations(move: Move) -> list[str]:
    assert move.step is not None  # noqa: S101 - told() asks before
    words: list[str] = []
    pending: list[Change] = []
    for happening in move.step.happenings:
        if isinstance(happening, Change):
            pending.append(happening)
            continue
        if happening.state is ExecutionState.RESOURCE_INVARIANT_VIOLATED:
            by = f"{happening.execution.skill} {happening.execution.id} "
            own = [change for change in pending if change.cause.startswith(by)]
            words.append(f"`{happening.result}` of {happening.execution.skill} is false and ends it{_listed(own)}")
        pending = []
    return words


def _listed(changes: Sequence[Change]) -> str:
    return ": " + ", ".join(f"{c.resource} {c.source} -> {c.target}" for c in changes) if changes else ""


def _what(fault: tuple[str, ...]) -> str:
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


_FAULTS = {
    "effect": "the effect of {what} is no transition from here",
    "post": "the postcondition of {what} is false now",
}
