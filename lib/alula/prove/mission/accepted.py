"""Findings that an author accepts in the mission's file, with a reason, where Groot2 shows and keeps what a node is about.

    <Fallback name="mapping mission" _description="accepted ALU701 (left by navigation.takeoff as keep_sdk_authority): why that is meant">

What stands in parentheses must be in the finding's message; without it, each finding of the code at this node is accepted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from alula.language.errors import Diagnostic, Severity
from alula.model.span import Span
from alula.trees.errors import Place
from alula.trees.node import Node

DESCRIPTION = "_description"
NEXT = r"\baccepted ALU7|\bproperty\s+\w+\s*:|\Z"
"""Where what a description says for the search ends at the latest."""
_ACCEPTED = re.compile(rf"\baccepted (?P<code>ALU7\d\d)(?: \((?P<words>[^)]*)\))?:(?P<reason>.*?)(?={NEXT})", re.DOTALL)


@dataclass(frozen=True)
class Acceptance:
    """What an author accepts: the findings of a code about a node, those with these words in their messages."""

    place: Place
    code: str
    words: str
    reason: str

    def of(self, finding: Diagnostic) -> bool:
        """Return whether a finding is accepted."""
        span = finding.span
        here = (span.file, span.line, span.column) == (self.place.path, self.place.line, self.place.column)
        return here and finding.code == self.code and self.words in finding.message and bool(self.reason)


def acceptances(nodes: Sequence[Node]) -> list[Acceptance]:
    """Return what the nodes' descriptions accept; a subtree that is used several times counts once."""
    return list(dict.fromkeys(one for node in nodes for one in _of(node)))


def _of(node: Node) -> Iterator[Acceptance]:
    element = node.config.element
    for match in _ACCEPTED.finditer(element.get(DESCRIPTION)):
        yield Acceptance(element.place, match["code"], match["words"] or "", match["reason"].strip())


def divided(
    found: Sequence[Diagnostic], known: Sequence[Acceptance], path: str, *, complete: bool
) -> tuple[list[Diagnostic], list[Diagnostic]]:
    """Return the findings that nobody accepts, then those that are accepted.

    Among the first are acceptances without a reason and, where all runs were looked at, those of the mission's own file that match
    nothing: an included file is also another mission's.
    """
    accepted = [finding for finding in found if any(one.of(finding) for one in known)]
    left = [finding for finding in found if finding not in accepted]
    for one in known:
        if not one.reason:
            left.append(_finding(one, f"the acceptance of {one.code} gives no reason", "say why after the colon"))
        elif complete and one.place.path == path and not any(one.of(finding) for finding in accepted):
            words = f" ({one.words})" if one.words else ""
            left.append(_finding(one, f"there is no {one.code}{words} here that could be accepted", "take the acceptance away"))
    return left, accepted


def _finding(one: Acceptance, message: str, cure: str) -> Diagnostic:
    span = Span(one.place.path, one.place.line, one.place.column, one.place.column + 1)
    return Diagnostic("ALU712", message, span, Severity.WARNING, cure)
