"""The search one situation at a time."""

from __future__ import annotations

from skill_language.errors import Diagnostic
from skill_language.prove.abstract import Abstraction
from skill_language.prove.explore import explore
from skill_language.prove.limits import Deadline
from skill_language.prove.local import Suspect
from skill_language.prove.properties import check_property
from skill_language.prove.reachable import check_graph, crowded, decide
from skill_language.prove.steps import World
from skill_model.model import Skillset


def search(
    skillset: Skillset, abstraction: Abstraction, suspects: list[Suspect], deadline: Deadline, *, most: int, copies: int
) -> list[Diagnostic] | None:
    """Return all global findings, or None when there are more than ``most`` situations."""
    graph = explore(World(abstraction, copies=copies), deadline, most=most)
    if not graph.complete:
        return None
    findings = decide(skillset, graph, suspects)
    findings += check_graph(skillset, graph)
    findings += crowded(skillset, graph.world.crowded, copies)
    for wanted in skillset.properties:
        deadline.check()
        found = check_property(graph, wanted)
        findings += [found] if found else []
    return findings
