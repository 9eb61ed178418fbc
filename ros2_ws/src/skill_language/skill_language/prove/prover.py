"""Puts the proofs together: local checks, then the reachable situations one by one, or as sets where there are many."""

from __future__ import annotations

from dataclasses import replace

from skill_language.errors import Severity
from skill_language.prove.abstract import without_data
from skill_language.prove.finding import Finding, strictly
from skill_language.prove.limits import Deadline, OutOfTimeError
from skill_language.prove.local import Suspect, local_checks
from skill_model.model import Skillset

MOST_SITUATIONS = 2000
"""More situations than this are not looked at one by one, but as sets; see ``bench``."""

COPIES = 2
"""So many executions of one skill are looked at at once."""


def prove(
    skillset: Skillset, *, strict: bool = False, timeout_s: float = 30.0, most: int = MOST_SITUATIONS, copies: int = COPIES
) -> list[Finding]:
    """Return what is wrong with a skillset that the checker finds no error in, in the order of the source.

    What could not be decided within ``timeout_s`` seconds is a finding as well (ALU540). ``strict`` makes errors of
    warnings. The skillset must be free of errors of ``skill_language.check``: every name in it leads somewhere. ``most``
    is how many situations are looked at one by one before they are taken as sets, ``copies`` how many executions of one
    skill at once.
    """
    deadline = Deadline.after(timeout_s)
    findings: list[Finding] = []
    suspects: list[Suspect] = []
    try:
        findings, suspects = local_checks(skillset, deadline)
        findings += _search(skillset, suspects, deadline, most, copies)
    except OutOfTimeError:
        findings += [_unsure(suspect, deadline) for suspect in suspects]
        findings.append(_undecided(skillset, deadline))
    findings = list(dict.fromkeys(findings))
    findings.sort(key=lambda finding: (finding.span.line, finding.span.column, finding.code))
    return strictly(findings) if strict else findings


def _search(skillset: Skillset, suspects: list[Suspect], deadline: Deadline, most: int, copies: int) -> list[Finding]:
    # The runtime's semantics is needed from here on, and only from here on (see ``steps``).
    from skill_language.prove import explicit, symbolic

    abstraction = without_data(skillset, deadline)
    found = explicit.search(skillset, abstraction, suspects, deadline, most=most, copies=copies)
    if found is None:
        found = symbolic.search(skillset, abstraction, suspects, deadline, copies=copies)
    return found


def _undecided(skillset: Skillset, deadline: Deadline) -> Finding:
    """Return ALU540: an error where the user wants something proved."""
    severity = Severity.ERROR if skillset.properties else Severity.WARNING
    message = f"not proved within {deadline.given_s:g} s"
    return Finding("ALU540", message, skillset.span, severity, "allow more time, or model the skillset with fewer resources")


def _unsure(suspect: Suspect, deadline: Deadline) -> Finding:
    message = f"{suspect.finding.message}; whether it comes to that was not found out within {deadline.given_s:g} s"
    return replace(suspect.finding, message=message)
