"""Puts the proofs together: local checks, then the reachable situations one by one, or as sets where there are many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from alula.language.errors import Diagnostic, Severity
from alula.language.outside import NamedTransition, opened, untaken
from alula.model.model import Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.skillset import explicit
from alula.prove.skillset.abstract import Abstraction, without_data
from alula.prove.skillset.local import Suspect, local_checks

MOST_SITUATIONS = 2000
"""More situations than this are not looked at one by one, but as sets; see ``bench``."""

COPIES = 2
"""So many executions of one skill are looked at at once."""


def prove(
    skillset: Skillset,
    *,
    closed_world: bool = False,
    timeout_s: float = 30.0,
    most: int = MOST_SITUATIONS,
    copies: int = COPIES,
    on_progress: Callable[[str], None] | None = None,
) -> list[Diagnostic]:
    """Return what is wrong with a skillset that the checker finds no error in, in the order of the source.

    A transition that nothing in the model makes may be made from outside (see ``outside``), unless ``closed_world``. What could not
    be decided within ``timeout_s`` seconds is a finding as well (ALU540). The skillset must be free of errors of
    ``alula.language.check``: every name in it leads somewhere. ``most`` is how many situations are looked at one by one before they
    are taken as sets, ``copies`` how many executions of one skill at once. ``on_progress`` hears now and then what takes long.
    """
    deadline = Deadline.after(timeout_s, on_progress)
    findings: list[Diagnostic] = []
    suspects: list[Suspect] = []
    try:
        deadline.doing = "each block alone"
        findings, suspects = local_checks(skillset, deadline)
        search = _Search(skillset, suspects, deadline, most, copies)
        findings += search.findings() if closed_world else search.open_findings()
    except OutOfTimeError:
        findings += [_unsure(suspect, deadline) for suspect in suspects]
        findings.append(_undecided(skillset, deadline))
    findings = list(dict.fromkeys(findings))
    findings.sort(key=lambda finding: (finding.span.line, finding.span.column, finding.code))
    return findings


@dataclass(frozen=True)
class _Search:
    """The search through what can be reached."""

    skillset: Skillset
    suspects: list[Suspect]
    deadline: Deadline
    most: int
    copies: int

    def findings(self, outside: frozenset[NamedTransition] = frozenset()) -> list[Diagnostic]:
        """Return all global findings, with these transitions made from outside as well."""
        skillset = opened(self.skillset, outside) if outside else self.skillset
        abstraction = without_data(skillset, self.deadline, outside)
        self.deadline.doing = "situations one by one"
        found = explicit.search(skillset, abstraction, self.suspects, self.deadline, most=self.most, copies=self.copies)
        return self._as_sets(skillset, abstraction) if found is None else found

    def _as_sets(self, skillset: Skillset, abstraction: Abstraction) -> list[Diagnostic]:
        """Return all global findings; what a few skills show against a property is among them also where time is too short for the rest."""
        # Late: diagrams take a moment to load, and few situations are looked at without them.
        from alula.prove.skillset import few, symbolic

        quick = self.deadline.half("properties, with a few skills")
        refuted = few.refuted(abstraction, skillset.properties, quick, copies=self.copies)
        self.deadline.doing = "situations as sets"
        others = replace(skillset, properties=tuple(wanted for wanted in skillset.properties if wanted.name not in refuted))
        try:
            return [*refuted.values(), *symbolic.search(others, abstraction, self.suspects, self.deadline, copies=self.copies)]
        except OutOfTimeError:
            if not refuted:
                raise
            unsure = [_unsure(suspect, self.deadline) for suspect in self.suspects]
            return [*refuted.values(), *unsure, _undecided(others, self.deadline)]

    def open_findings(self) -> list[Diagnostic]:
        """Return the findings of the model alone, and the errors that transitions which nothing makes lead to."""
        findings = self.findings()
        transitions = untaken(self.skillset)
        if not transitions:
            return findings
        known = {(f.code, f.span) for f in findings if f.severity is Severity.ERROR}
        errors = [_from_outside(f) for f in self.findings(transitions) if f.severity is Severity.ERROR and (f.code, f.span) not in known]
        shown = {(f.code, f.span) for f in errors}
        return [f for f in findings if (f.code, f.span) not in shown] + errors


def _from_outside(finding: Diagnostic) -> Diagnostic:
    """Say of a finding that it needs transitions which nothing in the model makes."""
    missing = "nothing in the model makes the transition that comes from outside"
    hint = f"{missing}: make it `extern`, add a skill or event that takes it, or use `--closed-world`"
    return replace(finding, hint=f"{finding.hint}; {hint}" if finding.hint else hint)


def _undecided(skillset: Skillset, deadline: Deadline) -> Diagnostic:
    """Return ALU540: an error where the user wants something proved."""
    severity = Severity.ERROR if skillset.properties else Severity.WARNING
    message = f"not proved within {deadline.given_s:.3g} s"
    return Diagnostic("ALU540", message, skillset.span, severity, "allow more time, or model the skillset with fewer resources")


def _unsure(suspect: Suspect, deadline: Deadline) -> Diagnostic:
    message = f"{suspect.finding.message}; whether that is reachable was not decided within {deadline.given_s:.3g} s"
    return replace(suspect.finding, message=message)
