"""The findings about all runs of a mission that need no property."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from alula.language.errors import Diagnostic, Severity
from alula.model.model import Property
from alula.model.span import Span
from alula.prove.limits import Deadline
from alula.prove.mission.deciding import answers_of, never_coming, never_deciding
from alula.prove.mission.fights import fights
from alula.prove.mission.left import left_taken
from alula.prove.mission.refusals import Refusal, failing, refusal_of
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import GOOD, FailureResponses, Row
from alula.prove.mission.run import MissionFinding, MissionRun, run_of
from alula.prove.mission.system import FAILED, System
from alula.prove.mission.waits import Waits
from alula.prove.mission.words import situation, told
from alula.trees.node import Node

WAITS = "ALU704"
OWN = "ALU715"
ANSWER = "put a Fallback around it with what is to be done then, or `<AlwaysFailure/>` where giving up is meant"


def findings(regions: Regions, responses: FailureResponses) -> list[Diagnostic]:
    """Return what is wrong, or can go wrong, each finding with a run that shows it."""
    found = leaving_and_fighting(regions)
    # What never happens is known only when all runs were looked at.
    return [*found, *_unanswered(regions, responses), *_never(regions)] if regions.complete else found


def leaving_and_fighting(regions: Regions) -> list[Diagnostic]:
    """Return the skills that a mission leaves unable to start (ALU701), and the branches that fight for a resource (ALU708)."""
    return [*_left_taken(regions), *_fighting(regions)]


def taken_as(system: System, *, exactly: bool = True) -> Iterator[Diagnostic]:
    """Yield ALU715, once for each type of node of the robot's own that has children or no class: how the search takes it.

    ``exactly``: also of those that it takes as they are.
    """
    for one in system.own.taken:
        node = next((node for node in system.nodes if node.config.type.name == one.name), None)
        if node is None or not (exactly or one.why_not):
            continue
        if not one.why_not:
            how = "is ticked by its class, and its children with it"
        elif one.children:
            how = f"may tick and halt its children in any order, and answer and write anything: {one.why_not}"
        else:
            how = f"may answer and write anything: {one.why_not}"
        found = _finding(OWN, f"'{one.name}' {how}", node, "")
        yield replace(found, severity=Severity.NOTE)


def unless_held_up(system: System, one: Property) -> Iterator[Diagnostic]:
    """Yield ALU715 for a property of what must come that holds, where nodes may do anything: also nothing, for ever."""
    names = sorted({f"'{node.config.type.name}'" for node in system.nodes} & {f"'{name}'" for name in system.own.names_of_any_order})
    if names:
        message = f"the property `{one.name}` ({one.kind.value}) holds unless {' or '.join(names)} keeps it from coming for ever"
        yield Diagnostic(OWN, message, one.span, Severity.WARNING, "have the search run its class, or ask what must come `within N ticks`")


def _left_taken(regions: Regions) -> Iterator[Diagnostic]:
    """Yield ALU701 for skills that nothing but a restart makes ready again after the mission, for each end that leaves it so."""
    system = regions.system
    for one in left_taken(regions):
        skillset = system.skillsets[one.place]
        first = {resource.name: resource.initial for resource in skillset.resources}
        held = [f"{skillset.name}.{name} == {state}" for name, state in one.states.items() if state != first[name]]
        names = ", ".join(f"`{skillset.name}.{skill}`" for skill in one.lost)
        message = f"the mission can end ({one.end}) so that {names} can't start any more ({', '.join(held)})"
        message += f": left by {one.by}" if one.by else ""
        cure = "have the skill give back what it holds however it ends, or restart its managers before the next mission"
        states = tuple((f"{skillset.name}.{name}", state) for name, state in one.states.items())
        run = MissionRun(one.events, one.end, states, system.skillsets, system.own.why)
        yield _finding("ALU701", message, system.nodes[0], cure, told(system, run.events), run)


def _unanswered(regions: Regions, responses: FailureResponses) -> Iterator[Diagnostic]:
    """Yield ALU702 for failures after which the tree asks for nothing any more, and the mission is not accomplished; ALU705: refusals."""
    seen: set[tuple[int, str]] = set()
    for row in responses.rows:
        if row.starts or row.outcomes & GOOD or not row.loses or not row.outcomes:
            continue
        refusal = refusal_of(regions, row)
        if refusal is not None and (row.leaf, refusal.how) not in seen:
            seen.add((row.leaf, refusal.how))
            yield _refused(regions, row, refusal)
        way = failing(regions, row)
        if way is None or (row.leaf, "ALU702") in seen:
            continue
        seen.add((row.leaf, "ALU702"))
        how = "fails" if row.end == FAILED else f"ends with {row.end}"
        message = f"nothing answers when `{row.skill}` {how}: the mission ends ({', '.join(sorted(row.outcomes))})"
        run = run_of(regions.system, *regions.run_on(way[0], *way[1]))
        yield _finding("ALU702", message, regions.system.leaves[row.leaf], ANSWER, told(regions.system, run.events), run)


def _refused(regions: Regions, row: Row, refusal: Refusal) -> Diagnostic:
    system = regions.system
    race = f", because after the tree has asked {refusal.race}" if refusal.race else ""
    message = f"nothing answers when a request for `{row.skill}` is refused: {refusal.by}{race}: the mission ends"
    run = run_of(system, refusal.events, refusal.state)
    message += f" ({run.outcome})"
    return _finding("ALU705", message, system.leaves[row.leaf], ANSWER, told(system, run.events), run)


def _fighting(regions: Regions) -> Iterator[Diagnostic]:
    """Yield ALU708 for requests that are refused because of what runs, and are asked for again meanwhile."""
    system = regions.system
    for one in fights(regions):
        asking, holding = (system.leaves[leaf] for leaf in (one.asking, one.holding))
        message = (
            f"'{asking.name}' and '{holding.name}' fight for {one.resource}: `{asking.skillset}.{asking.model.name}` is refused while "
        )
        message += f"`{holding.skillset}.{holding.model.name}` runs, and is asked for again meanwhile"
        run = run_of(system, one.events, one.state)
        cure = "have one branch wait until the other has ended, or end it first"
        yield _finding("ALU708", message, asking, cure, told(system, one.events), run)


def _never(regions: Regions) -> Iterator[Diagnostic]:
    """Yield what never happens: nodes that are never ticked, conditions that never decide, ends that never come."""
    yield from _never_ticked(regions)
    for node, true in never_deciding(regions.system, answers_of(regions)):
        message = f"'{node.name}' never decides: it is always {'true' if true else 'false'} when it is ticked"
        yield _finding("ALU706", message, node, "take it away, or ask for what can be otherwise there")
    for node, asked, whose in never_coming(regions):
        message = f"`{asked}` is asked, but {f'{whose} never ends' if whose else 'no skill ever ends'} so"
        yield _finding("ALU707", message, node, "ask for an end that can come there, or have it come")


def _never_ticked(regions: Regions) -> Iterator[Diagnostic]:
    """Yield ALU703 for nodes that no run ticks; nodes below one of them are left out."""
    ticked = {number for region in regions.regions for _, one in region.next for outcome, _ in one.ways for number, _ in outcome.touched}
    nodes = regions.system.nodes
    never = {id(node) for number, node in enumerate(nodes) if number not in ticked and node in regions.system.trees[0].nodes}
    for node in nodes:
        if id(node) in never and id(node.parent) not in never:
            yield _finding("ALU703", f"'{node.name}' is never ticked", node, "take it away, or put it where it is reached")


def waits(looked: Waits, system: System, deadline: Deadline) -> Iterator[Diagnostic]:
    """Yield ALU704 for situations after which the mission never ends, each with a run to it; raises OutOfTimeError."""
    for node, events, state, stays, data in looked.found(deadline):
        how = f"waits in '{node.name}' for ever" if stays else f"goes round '{node.name}' without end"
        message = f"the mission {how}, though nothing fails any more: {situation(system, state)}{f', {data}' if data else ''}"
        cure = "wait with Timeout, Awaits or `within`, try again a number of times, or leave the loop"
        yield _finding(WAITS, message, node, cure, told(system, events), run_of(system, events, state))


def _finding(code: str, message: str, node: Node, cure: str, lines: tuple[str, ...] = (), run: MissionRun | None = None) -> Diagnostic:
    place = node.config.element.place
    span = Span(place.path, place.line, place.column, place.column + 1)
    return MissionFinding(code, message, span, Severity.WARNING, cure, example=lines, run=run)
