"""What the prover finds: a code, its place, and a story that shows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from skill_language.errors import Diagnostic, Severity
from skill_model.model import NOWHERE, Span


@dataclass(frozen=True)
class Finding:
    """One finding of the prover; ``counterexample`` has a line for each step of its story, or for what must come together."""

    code: str
    message: str
    span: Span = NOWHERE
    severity: Severity = Severity.ERROR
    hint: str = ""
    counterexample: tuple[str, ...] = ()

    def diagnostic(self) -> Diagnostic:
        """Return the finding as the checker's own kind."""
        return Diagnostic(self.code, self.message, self.span, self.severity, self.hint, counterexample=self.counterexample)


def strictly(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings with every warning made an error."""
    return [replace(finding, severity=Severity.ERROR) for finding in findings]
