"""Search the reachable situations one by one."""

from __future__ import annotations

from alula.language.errors import Diagnostic
from alula.model.model import Skillset
from alula.prove.limits import Deadline
from alula.prove.skillset.abstract import Abstraction
from alula.prove.skillset.explore import explore
from alula.prove.skillset.local import Suspect
from alula.prove.skillset.properties import check_property
from alula.prove.skillset.reachable import check_graph, crowded, decide
from alula.prove.skillset.steps import TransitionSystem


def search(
    skillset: Skillset, abstraction: Abstraction, suspects: list[Suspect], deadline: Deadline, *, most: int, copies: int
) -> list[Diagnostic] | None:
    """Return all global findings, or None when there are more than ``most`` situations."""
    graph = explore(TransitionSystem(abstraction, copies=copies), deadline, most=most)
    if not graph.complete:
        return None
    findings = decide(skillset, graph, suspects)
    findings += check_graph(skillset, graph)
    findings += crowded(skillset, graph.system.crowded, copies)
    for wanted in skillset.properties:
        deadline.check()
        found = check_property(graph, wanted)
        findings += [found] if found else []
    return findings
