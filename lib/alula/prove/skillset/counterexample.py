"""Put a way through the situations into words: each step is taken again with data and time, by the semantics.

The search leaves data and time out: what they decide may go either way. A counterexample names values that show the way.
Where none are found (two invariants may want different values at once), the rest of the way is told as the search took it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.language.counterexamples import Counterexample
from alula.prove.skillset.explore import Edge, Graph
from alula.prove.skillset.replay import Replay
from alula.prove.skillset.steps import Key, Move, State, TransitionSystem


def of_way(graph: Graph, way: Sequence[Edge], last: Move | None = None, fault: Key = ()) -> Counterexample:
    """Return the run along a way, and of a last step that shows a fault."""
    moves = [move_of(graph, edge) for edge in way]
    return walked(graph.system, graph.states[0], moves if last is None else [*moves, last], fault)


def walked(system: TransitionSystem, first: State, moves: Iterable[Move], fault: Key = ()) -> Counterexample:
    """Return the run of steps from the initial situation; the last one shows the fault if there is one."""
    replay = Replay(system, first)
    several = list(moves)
    for number, move in enumerate(several, 1):
        replay.take(move, fault if number == len(several) else ())
    return Counterexample(tuple(replay.steps))


def to(graph: Graph, number: int, last: Move | None = None, fault: Key = ()) -> Counterexample:
    """Return the run along a shortest way to a situation."""
    return of_way(graph, graph.path(number), last, fault)


def lasso(graph: Graph, way: Sequence[Edge], loop: Sequence[Edge]) -> Counterexample:
    """Return the run along a way and the loop after it; without a loop, nothing more can happen at its end."""
    replay = Replay(graph.system, graph.states[0])
    for edge in way:
        replay.take(move_of(graph, edge))
    for edge in loop:
        replay.take(move_of(graph, edge), loop=True)
    return Counterexample(tuple(replay.steps), stops=not loop)


def move_of(graph: Graph, edge: Edge) -> Move:
    """Take the step of an edge again, for its details."""
    target = graph.states[edge.target]
    for move in graph.system.moves(graph.states[edge.source]):
        if move.target == target and move.kind is edge.kind and move.subject == edge.subject and move.step is not None:
            return move
    raise LookupError(edge)


def situation(system: TransitionSystem, state: State) -> str:
    """Return a situation in words: ``motion == Off, goto running``."""
    names = [resource.name for resource in system.skillset.resources]
    words = [f"{name} == {value}" for name, value in zip(names, state.resources, strict=True)]
    return ", ".join([*words, *(f"{skill} running" for skill in state.running)])
