"""A run of a mission in words: a line for each event, and for each tick its requests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alula.prove.mission.oracle import Asked
from alula.prove.mission.state import Ending, Event, Kind, State
from alula.prove.mission.system import System


def told(system: System, events: Sequence[Event]) -> tuple[str, ...]:
    """Return the run as numbered lines, without ticks that request nothing."""
    lines = [line for event in events for line in _lines(system, event)]
    return tuple(f"{number}. {line}" for number, line in enumerate(lines, 1))


def situation(system: System, state: State) -> str:
    """Return a situation in words: states that differ from power-up, running executions, and the outcome or the innermost active node."""
    first = system.initial()
    names = [f"{one.name}.{resource.name}" for one in system.skillsets for resource in one.resources]
    words = [f"{name} == {system.resource(state, name)}" for name in names if system.resource(state, name) != system.resource(first, name)]
    skills = ((f"{system.leaves[leaf].skillset}.{system.leaves[leaf].model.name}", one) for leaf, one in system.open(state))
    words += [f"{skill} running" for skill, one in skills if one.phase == "running"]
    end = system.outcome(state)
    words.append(f"outcome {end.value}" if end else ", ".join(f"active('{node.name}')" for node in system.active(state)[-1:]))
    return ", ".join(word for word in words if word)


def _lines(system: System, event: Event) -> Iterator[str]:
    match event.kind:
        case Kind.TICK | Kind.ABORT:
            asked = [f"asks for {_leaf(system, leaf)}" for leaf in event.started]
            asked += [f"asks for the end of {_leaf(system, leaf)}" for leaf in event.interrupted]
            chosen = [words for one in event.choices if (words := choice(one))]
            begins = "someone aborts the mission" if event.kind is Kind.ABORT else "the tree is ticked"
            if asked or chosen or event.kind is Kind.ABORT:
                yield "; ".join([begins, *chosen, *asked])
        case Kind.START:
            yield f"{event.skill} starts{_changes(event)}{_violated(event, event.leaf)}"
        case Kind.REFUSE:
            yield f"{event.skill} is refused: {event.state}{f' ({event.result})' if event.result else ''}"
        case Kind.RESULT:
            yield f"{event.skill} ends with {event.result}{_changes(event)}{_violated(event, event.leaf)}"
        case Kind.INTERRUPT:
            yield f"{event.skill} is interrupted{_changes(event)}{_violated(event, event.leaf)}"
        case Kind.BREAK:
            yield f"data or time break `{event.result}` of {event.skill}{_changes(event)}{_violated(event, event.leaf)}"
        case Kind.EXTERN:
            others = [one for one in event.changes if one[0] != event.name]
            more = _changes(event._replace(changes=tuple(others)))
            yield f"the functional layer: {event.skill} {event.source} -> {event.result}{_violated(event, -1)}{more}"
        case Kind.EVENT:
            yield f"event {event.skill}{_changes(event)}{_violated(event, -1)}"
        case _:
            yield _failed(event)


def _failed(event: Event) -> str:
    """Return an event that no model has in words: a function raises, or managers die or restart."""
    match event.kind:
        case Kind.FAIL:
            return f"{event.skill} fails: its function raises{_changes(event)}{_violated(event, event.leaf)}"
        case Kind.PAUSE:
            how = f"is interrupted, because it does not go on{_changes(event)}{_violated(event, event.leaf)}"
            return f"someone pauses the mission and has it go on: {event.skill} {how}"
        case Kind.DIE:
            return f"the managers of {event.skillset} die"
    return f"the managers of {event.skillset} are there again"


def _leaf(system: System, leaf: int) -> str:
    node = system.leaves[leaf]
    return f"{node.skillset}.{node.model.name} ('{node.name}')"


def choice(one: Asked) -> str:
    """Return the observation or the node's answer of a tick in words; empty where it explains nothing."""
    match one.question:
        case ("time", str(duration)):
            return f"{float(duration) / 1e9:g} s are over" if one.answer and float(duration) >= 1e6 else ""
        case ("does", str(name)):
            return f"'{name}' {one.answer}"
        case ("answer", str(name)):
            return f"'{name}' answers {one.answer}"
        case ("data", str(what), "fresh", _):
            return "" if one.answer else f"{what} is not fresh"
        case ("data", str(what), "number", _):
            return "" if one.answer else f"{what} is no number"
        case (("compare" | "data"), str(what), str(symbol), str(other)):
            return f"{what} is {'' if one.answer else 'not '}{symbol} {other}"
    return ""


def _changes(event: Event) -> str:
    return ": " + ", ".join(f"{name} {source} -> {target}" for name, source, target in event.changes) if event.changes else ""


def _violated(event: Event, but: int) -> str:
    return "".join(f"; {_end(one)}" for one in event.ended if one.leaf != but)


def _end(ending: Ending) -> str:
    return f"`{ending.result}` of {ending.skill} is false and ends it" if ending.result else f"{ending.skill} ends as {ending.state}"
