"""Applies all rules to a skillset."""

from __future__ import annotations

from itertools import chain, islice

from alula.language.check.skill_rules import SKILL_RULES
from alula.language.check.skillset_rules import RULES
from alula.language.errors import Diagnostic
from alula.model.model import Skillset

MAX_FINDINGS = 200


def check(skillset: Skillset) -> list[Diagnostic]:
    """Return all findings about a skillset (at most ``MAX_FINDINGS``) in the order of the source."""
    about_all = (finding for rule in RULES for finding in rule(skillset))
    about_one = (finding for skill in skillset.skills for rule in SKILL_RULES for finding in rule(skillset, skill))
    # More are not read, and a file may be made to have a hundred thousand.
    findings = islice(chain(about_all, about_one), MAX_FINDINGS)
    return sorted(dict.fromkeys(findings), key=lambda d: (d.span.line, d.span.column, d.code))
