"""What the prover finds: a code, its place, and a story that shows it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from skill_language.errors import Diagnostic, Severity
from skill_language.model import NOWHERE, Span

CODES: Mapping[str, str] = {
    "ALU501": "an event's guard can't succeed",
    "ALU502": "an event's guard can't fail",
    "ALU503": "an event's effect can fail",
    "ALU504": "a precondition can't succeed",
    "ALU505": "a precondition can't fail",
    "ALU506": "a start effect can fail",
    "ALU507": "an invariant can't succeed",
    "ALU508": "an invariant can't fail",
    "ALU509": "an invariant's effect can fail",
    "ALU510": "an invariant can be false right after the start",
    "ALU511": "an interruption's effect can fail",
    "ALU512": "an interruption's postcondition can fail",
    "ALU513": "the effect of a success can fail",
    "ALU514": "the postcondition of a success can fail",
    "ALU515": "the effect of a failure can fail",
    "ALU516": "the postcondition of a failure can fail",
    "ALU521": "a state that no execution ever reaches",
    "ALU522": "a skill that can never start",
    "ALU523": "a resource that two executions can hold at once",
    "ALU524": "a situation from which a skill can never start again",
    "ALU525": "an effect that fails in a reachable situation",
    "ALU526": "more executions of one skill at once than are looked at",
    "ALU531": "a property does not hold",
    "ALU540": "not proved in the time given",
}


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
