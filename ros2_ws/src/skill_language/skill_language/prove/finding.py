"""What the prover finds: a code, its place, and a story that shows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from skill_language.errors import Diagnostic, Severity
from skill_language.stories import NO_STORY, Story
from skill_model.span import NOWHERE, Span


@dataclass(frozen=True)
class Finding:
    """One finding of the prover.

    ``example`` has a line for each state and value that must come together, ``story`` is how it comes to that.
    """

    code: str
    message: str
    span: Span = NOWHERE
    severity: Severity = Severity.ERROR
    hint: str = ""
    example: tuple[str, ...] = ()
    story: Story = NO_STORY

    @property
    def counterexample(self) -> tuple[str, ...]:
        """The lines of example and story."""
        return (*self.example, *self.story.lines)

    def diagnostic(self) -> Diagnostic:
        """Return the finding as the checker's own kind."""
        return Diagnostic(self.code, self.message, self.span, self.severity, self.hint, example=self.example, story=self.story)


def strictly(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings with every warning made an error."""
    return [replace(finding, severity=Severity.ERROR) for finding in findings]
