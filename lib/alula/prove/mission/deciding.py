"""Conditions that never decide anything, and ends of skills that are tested for and never come, once all runs are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alula.missions.skill_types import OUTCOME_PORT
from alula.prove.mission.regions import Regions
from alula.prove.mission.system import System
from alula.trees.access import Key, named_entries, written_entries
from alula.trees.node import Node
from alula.trees.script.syntax import Call, Comparison, Literal, Name
from alula.trees.status import Status

Answers = Mapping[int, frozenset[str]]
"""By the node's number all that it ever answers; a node that stands in several places, as part of a subtree, has one set for all."""


def answers_of(regions: Regions) -> Answers:
    """Return the answers of the nodes; a node that is never ticked has none."""
    nodes = regions.system.nodes
    found: dict[int, set[str]] = {}
    for region in regions.regions:
        for _, ticked in region.next:
            for outcome, _ in ticked.ways:
                for number, status in outcome.touched:
                    found.setdefault(id(nodes[number].config.element), set()).add(status)
    return {number: frozenset(found.get(id(node.config.element), ())) for number, node in enumerate(nodes)}


def never_deciding(system: System, answers: Answers) -> Iterator[tuple[Node, bool]]:
    """Yield conditions that are always true, or always false; not those before a node that is never ticked, which says the same."""
    told: set[int] = set()
    number_of = {id(node): number for number, node in enumerate(system.nodes)}
    for number, node in enumerate(system.nodes):
        if not node.answers_by or len(answers[number]) != 1 or id(node.config.element) in told:
            continue
        (answer,) = answers[number]
        siblings = node.parent.children if node.parent is not None else [node]
        after = siblings[siblings.index(node) + 1 :]
        if answer != Status.RUNNING.value and not (after and not answers[number_of[id(after[0])]]):
            told.add(id(node.config.element))
            yield node, answer == Status.SUCCESS.value


def never_coming(regions: Regions) -> Iterator[tuple[Node, str, str]]:
    """Yield nodes that test for an end that comes in no run: the node, the end, and the skills that it is to be of (empty: any)."""
    system = regions.system
    ends = _ends(regions)
    told: set[tuple[int, str]] = set()
    for node in system.nodes:
        for asked, whose in _asked(system, node, ends):
            if (id(node.config.element), asked) not in told:
                told.add((id(node.config.element), asked))
                yield node, asked, whose


def _ends(regions: Regions) -> Mapping[int, frozenset[str]]:
    """Return by leaf how its executions end: by a result, an invariant, a precondition, or a state."""
    system = regions.system
    known = {(place, number) for region in regions.regions for place, one in enumerate(region.closures) for number in one.all}
    found: dict[int, set[str]] = {leaf: set() for leaf in range(len(system.leaves))}
    for place, number in sorted(known):
        for event, _ in system.moves_of(place, number):
            for one in event.ended:
                found[one.leaf].add(one.result or one.state)
    return {leaf: frozenset(names) for leaf, names in found.items()}


def _asked(system: System, node: Node, ends: Mapping[int, frozenset[str]]) -> Iterator[tuple[str, str]]:
    for part in system.reads.accesses.parts(node.config):
        match part:
            case Call(function="failed", arguments=(Literal(value=str(end)) | Name(name=end),)):
                if not any(end in known for known in ends.values()):
                    yield f"failed('{end}')", ""
            case Comparison(operands=(Name(name=entry), Literal(value=str(end))), operators=("==" | "!=",)):
                leaves = _writers(system, node.blackboard.where(entry))
                if end and leaves and not any(end in ends[leaf] for leaf in leaves):
                    yield f"{entry} {part.operators[0]} '{end}'", ", ".join(sorted({f"'{system.leaves[leaf].name}'" for leaf in leaves}))


def _writers(system: System, entry: Key) -> list[int]:
    """Return the leaves whose outcomes an entry has, none where it may have anything else."""
    names = system.reads.sources({entry})
    for node in system.nodes:
        others = {node.blackboard.where(one) for one in written_entries(node).values()} | system.reads.asks(node.config).written
        if node not in system.leaves and names & others:
            return []
    return [leaf for leaf, node in enumerate(system.leaves) if _outcome(node) in names]


def _outcome(node: Node) -> Key | None:
    name = named_entries(node).get(OUTCOME_PORT)
    return None if name is None else node.blackboard.where(name)
