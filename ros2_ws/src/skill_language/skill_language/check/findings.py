"""Applies all rules to a skillset."""

from __future__ import annotations

from skill_language.check.skill_rules import SKILL_RULES
from skill_language.check.skillset_rules import RULES
from skill_language.errors import Diagnostic
from skill_language.model import Skillset


def check(skillset: Skillset) -> list[Diagnostic]:
    """Return all findings about a skillset in the order of the source."""
    findings = [finding for rule in RULES for finding in rule(skillset)]
    for skill in skillset.skills:
        findings += [finding for rule in SKILL_RULES for finding in rule(skillset, skill)]
    return sorted(dict.fromkeys(findings), key=lambda d: (d.span.line, d.span.column, d.code))
