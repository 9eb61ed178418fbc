"""What is wrong with a model: findings with a stable code (``codes``), their place, and how to mend it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum

from alula.common.errors import AlulaError
from alula.common.public import public
from alula.language.counterexamples import NO_COUNTEREXAMPLE, Counterexample
from alula.model.span import NOWHERE, Span


@public()
class Severity(Enum):
    """An error keeps a model from being used, a warning doesn't; a note is no defect, and is never made an error."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@public()
@dataclass(frozen=True)
class Diagnostic:
    """A finding about a model or a mission: its code, place (``span``), message, severity and what to do about it (``hint``).

    ``expected`` lists what the parser could have gone on with; ``source_line`` is the line that it is about.
    ``example``: conditions that must hold together for the finding; ``counterexample``: a run in which they do. Both are of proofs.
    ``for_generator``: a warning about a sound model that no code can be generated of; to the generator, it is an error.
    """

    code: str
    message: str
    span: Span = NOWHERE
    severity: Severity = Severity.ERROR
    hint: str = ""
    expected: tuple[str, ...] = ()
    example: tuple[str, ...] = ()
    counterexample: Counterexample = NO_COUNTEREXAMPLE
    for_generator: bool = False
    source_line: str = field(default="", compare=False)

    @property
    def counterexample_lines(self) -> tuple[str, ...]:
        """The lines of ``example``, then of ``counterexample``."""
        return (*self.example, *self.counterexample.lines)

    @property
    def playable(self) -> bool:
        """Return whether `check --play` plays its counterexample."""
        return bool(self.counterexample.steps)

    def render(self) -> str:
        """Return the finding as text for people: place, code, message, the line with a caret, what was expected, hint."""
        lines = [f"{_place(self.span)}{self.severity.value} {self.code}: {self.message}"]
        if self.span.line and self.source_line.strip():
            lines += _excerpt(self.span, self.source_line)
        if self.expected:
            lines.append(f"      = expected {'one of ' if len(self.expected) > 1 else ''}{', '.join(self.expected)}")
        if self.counterexample_lines:
            lines.append("      = counterexample:")
            lines += [f"          {line}" for line in self.counterexample_lines]
        if self.hint:
            lines.append(f"      = hint: {self.hint}")
        return "\n".join(lines)

    def as_json(self) -> dict[str, object]:
        """Return the finding as plain values for tools."""
        return {
            "code": self.code,
            "severity": self.severity.value,
            "message": self.message,
            "file": self.span.file,
            "line": self.span.line,
            "column": self.span.column,
            "end_column": self.span.end_column,
            "hint": self.hint,
            "expected": list(self.expected),
            "counterexample": list(self.counterexample_lines) or None,
            "steps": [step.as_json() for step in self.counterexample.steps] or None,
        }


@public()
class LanguageError(AlulaError):
    """All that was found in a file or robot, at least one error among it; ``str()`` is the rendered list."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics: tuple[Diagnostic, ...] = tuple(diagnostics)
        super().__init__(render(self.diagnostics))


def render(diagnostics: Iterable[Diagnostic]) -> str:
    """Return findings in the order given, an empty line between two."""
    return "\n\n".join(diagnostic.render() for diagnostic in diagnostics)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any finding is an error."""
    return any(diagnostic.severity is Severity.ERROR for diagnostic in diagnostics)


_WIDTH = 120


def _place(span: Span) -> str:
    if not span.file:
        return ""
    return f"{span}: " if span.line else f"{span.file}: "


def _excerpt(span: Span, source_line: str) -> list[str]:
    """Return the line and the caret below it, cut to a window where the line is very long."""
    start = max(0, span.column - 1 - _WIDTH // 2) if span.column > _WIDTH - 20 else 0
    shown = source_line[start : start + _WIDTH]
    column = span.column - 1 - start
    # A tab stays a tab below the line, so that the caret stands where the terminal puts the text.
    padding = "".join("\t" if character == "\t" else " " for character in shown[:column])
    length = max(1, min(span.end_column - span.column, len(shown) - column))
    printable = "".join(c if c.isprintable() or c == "\t" else "\N{REPLACEMENT CHARACTER}" for c in shown)
    return [f"{span.line:5} | {printable.rstrip()}", f"      | {padding}{'^' * length}"]
