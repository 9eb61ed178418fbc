"""The user's properties over the reachable situations.

A run begins in the initial situation and goes on as long as any step is possible: it is infinite, or ends where nothing
more can happen. skillsets/PROOFS.md, How to read a finding, has what is assumed of runs; ``fair`` is `assuming termination`.

NEVER and ALWAYS speak of single situations. EVENTUALLY and LEADS_TO are refuted by a lasso: a way to a loop (or to an
end) that avoids what should come. A fair loop is one in which each skill either does not run somewhere, or is ended by a
step of the loop: then the execution that has run longest can be the one that ends.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from alula.common.graphs import ShortestWays, components
from alula.language.counterexamples import Counterexample
from alula.language.errors import Diagnostic, Severity
from alula.model.expressions import And, Constant, Expression, Implies, Not, Or, ResourceIs, SkillRuns
from alula.model.model import Property, PropertyKind
from alula.prove.skillset import counterexample
from alula.prove.skillset.explore import Edge, Graph
from alula.prove.skillset.steps import State, TransitionSystem


def check_property(graph: Graph, wanted: Property, unknown: Collection[int] = ()) -> Diagnostic | None:
    """Return why a property does not hold, or None when it does; what comes after the ``unknown`` situations was not looked at."""
    graph.deadline.check()
    holds = [true_in(graph.system, wanted.condition, state) for state in graph.states]
    match wanted.kind:
        case PropertyKind.NEVER:
            return _found(graph, wanted, next((n for n, value in enumerate(holds) if value), None))
        case PropertyKind.ALWAYS:
            return _found(graph, wanted, next((n for n, value in enumerate(holds) if not value), None))
        case PropertyKind.EVENTUALLY:
            return lasso(graph, wanted, [0], _with(holds, unknown))
        case PropertyKind.LEADS_TO:
            then = [true_in(graph.system, wanted.consequence or Constant(value=False), state) for state in graph.states]
            return lasso(graph, wanted, [n for n, value in enumerate(holds) if value], _with(then, unknown))


def _with(values: list[bool], true: Collection[int]) -> list[bool]:
    return [value or number in true for number, value in enumerate(values)] if true else values


def true_in(system: TransitionSystem, condition: Expression, state: State) -> bool:
    """Return whether a condition over resources and executions is true in a situation."""
    match condition:
        case ResourceIs(resource=resource, state=value, negated=negated):
            index = next(i for i, r in enumerate(system.skillset.resources) if r.name == resource)
            return (state.resources[index] == value) != negated
        case SkillRuns(skill=skill):
            return skill in state.running
        case Constant(value=value):
            return value
        case Not(operand=operand):
            return not true_in(system, operand, state)
        case And(operands=operands):
            return all(true_in(system, operand, state) for operand in operands)
        case Or(operands=operands):
            return any(true_in(system, operand, state) for operand in operands)
        case Implies(premise=premise, conclusion=conclusion):
            return not true_in(system, premise, state) or true_in(system, conclusion, state)
        case _:
            raise ValueError(f"a property can't ask data: {condition}")


def failed(wanted: Property, what: str, run: Counterexample) -> Diagnostic:
    """Return ALU531, a property that does not hold: ``what`` it comes to, and the run in which it does."""
    message = f"property `{wanted.name}` ({wanted.kind.value}{', assuming termination' if wanted.fair else ''}) does not hold: {what}"
    return Diagnostic("ALU531", message, wanted.span, Severity.ERROR, counterexample=run)


def _found(graph: Graph, wanted: Property, number: int | None) -> Diagnostic | None:
    if number is None:
        return None
    return failed(wanted, counterexample.situation(graph.system, graph.states[number]), counterexample.to(graph, number))


# --- runs that never get there ----------------------------------------------------------------------------------------


def lasso(graph: Graph, wanted: Property, begins: list[int], goal: list[bool]) -> Diagnostic | None:
    """Search from each beginning, within the situations that are not the goal, for a loop or an end."""
    begins = [number for number in begins if not goal[number]]
    following = _avoiding(graph, goal)
    ways = ShortestWays(begins, following)
    for component in components(list(ways), lambda number: (after for _, after in following(number))):
        if _goes_on(graph, component, goal) and (not wanted.fair or _fair(graph, component)):
            loop = _loop(graph, component, fair=wanted.fair)
            end = loop[0].source if loop else component[0]
            way = ways.to(end)
            begin = way[0].source if way else end
            return failed(wanted, "a run never gets there", counterexample.lasso(graph, [*graph.path(begin), *way], loop))
    return None


def _avoiding(graph: Graph, goal: list[bool]) -> Callable[[int], Iterator[tuple[Edge, int]]]:
    """Return what follows a situation without the goal."""

    def following(number: int) -> Iterator[tuple[Edge, int]]:
        graph.deadline.check()
        return ((edge, edge.target) for edge in graph.edges[number] if not goal[edge.target])

    return following


def _goes_on(graph: Graph, component: list[int], goal: list[bool]) -> bool:
    """Return whether a run can stay in a component: round a loop, or because nothing more can happen at all."""
    inside = set(component)
    if any(edge.target in inside for number in component for edge in graph.edges[number]):
        return True
    return len(component) == 1 and not graph.edges[component[0]] and not goal[component[0]]


def _fair(graph: Graph, component: list[int]) -> bool:
    inside = set(component)
    always = set.intersection(*(set(graph.states[number].running) for number in component))
    ended = {skill for n in component for edge in graph.edges[n] if edge.target in inside for skill in edge.ended}
    return always <= ended


def _loop(graph: Graph, component: list[int], *, fair: bool) -> list[Edge]:
    """Return a loop in a component; a fair one comes by what ends each skill that runs all the time, and by a rest of each other."""
    inside = set(component)
    if not any(edge.target in inside for number in component for edge in graph.edges[number]):
        return []
    begin = component[0]
    way: list[Edge] = []
    here = begin
    if fair:
        while (missing := _unfair(graph, begin, way)) is not None:
            skill = missing
            way += _search(graph, inside, here, lambda e, skill=skill: skill in e.ended or skill not in graph.states[e.target].running)  # type: ignore[misc]
            here = way[-1].target
    if here != begin or not way:
        way += _search(graph, inside, here, lambda edge: edge.target == begin)
    return way


def _unfair(graph: Graph, begin: int, way: list[Edge]) -> str | None:
    """Return a skill that runs all along a way and is not ended by it."""
    passed = [begin, *(edge.target for edge in way)]
    always = set.intersection(*(set(graph.states[number].running) for number in passed))
    return next(iter(sorted(always - {skill for edge in way for skill in edge.ended})), None)


def _search(graph: Graph, inside: set[int], begin: int, wanted: Callable[[Edge], bool]) -> list[Edge]:
    """Return a shortest way within a component whose last step is wanted."""
    ways = ShortestWays([begin], lambda number: ((edge, edge.target) for edge in graph.edges[number] if edge.target in inside))
    for number in ways:
        for edge in graph.edges[number]:
            if edge.target in inside and wanted(edge):
                return [*ways.to(number), edge]
    raise LookupError(begin)
