"""`python -m skill_language.server`: a language server over the standard streams, for editors.

It tells the findings of the checker on every change, completes names, shows what a name stands for, and goes to its definition.
"""

from __future__ import annotations

from pathlib import Path

from lsprotocol import types as lsp
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path

from skill_language.editor import Place, Word, completions, definition, description, word_at
from skill_language.errors import Diagnostic, Severity
from skill_language.lexer import MAX_CHARACTERS
from skill_language.models import ModelFile, check_texts
from skill_model.model import Span

_SEVERITY = {Severity.ERROR: lsp.DiagnosticSeverity.Error, Severity.WARNING: lsp.DiagnosticSeverity.Warning}
_KIND = {
    "state": lsp.CompletionItemKind.EnumMember,
    "resource": lsp.CompletionItemKind.Enum,
    "skill": lsp.CompletionItemKind.Function,
    "effect": lsp.CompletionItemKind.Event,
    "data": lsp.CompletionItemKind.Variable,
    "type": lsp.CompletionItemKind.Class,
    "keyword": lsp.CompletionItemKind.Keyword,
}

server = LanguageServer("alula-skill-language", "0.1.0", text_document_sync_kind=lsp.TextDocumentSyncKind.Full)


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
def did_open(ls: LanguageServer, params: lsp.DidOpenTextDocumentParams) -> None:
    """Tell what is wrong with a file that was opened."""
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
def did_change(ls: LanguageServer, params: lsp.DidChangeTextDocumentParams) -> None:
    """Tell what is wrong with a file that was changed."""
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
def did_close(ls: LanguageServer, params: lsp.DidCloseTextDocumentParams) -> None:
    """Take back what was told about a file."""
    ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri=params.text_document.uri, diagnostics=[]))


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=[" ", "=", ">", "."]))
def completion(ls: LanguageServer, params: lsp.CompletionParams) -> lsp.CompletionList:
    """Return the names that may stand at the cursor."""
    file = _file(ls, params.text_document.uri)
    found = completions(file, _place(file, params.position))
    items = [lsp.CompletionItem(label=c.label, kind=_KIND[c.kind], detail=c.detail or None) for c in found]
    return lsp.CompletionList(is_incomplete=False, items=items)


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
def hover(ls: LanguageServer, params: lsp.HoverParams) -> lsp.Hover | None:
    """Return what the name under the pointer stands for."""
    file = _file(ls, params.text_document.uri)
    word = word_at(file, _place(file, params.position))
    text = description(file, word) if word else ""
    if not word or not text:
        return None
    contents = lsp.MarkupContent(kind=lsp.MarkupKind.Markdown, value=f"```skill\n{text}\n```")
    return lsp.Hover(contents=contents, range=_word_range(file, word))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
def go_to_definition(ls: LanguageServer, params: lsp.DefinitionParams) -> lsp.Location | None:
    """Return where the name under the pointer is defined."""
    file = _file(ls, params.text_document.uri)
    word = word_at(file, _place(file, params.position))
    span = definition(file, word) if word else None
    return lsp.Location(uri=params.text_document.uri, range=_range(file, span)) if span else None


def main() -> None:
    """Serve until the editor goes."""
    server.start_io()


def _publish(ls: LanguageServer, uri: str) -> None:
    file = _file(ls, uri)
    told = [_diagnostic(file, finding) for finding in file.findings]
    ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri=uri, diagnostics=told))


def _file(ls: LanguageServer, uri: str) -> ModelFile:
    """Read and check a document as the editor has it."""
    text = ls.workspace.get_text_document(uri).source[: MAX_CHARACTERS + 1]
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return check_texts([ModelFile(to_fs_path(uri) or Path(uri).name, text)])[0]


def _diagnostic(file: ModelFile, finding: Diagnostic) -> lsp.Diagnostic:
    parts = [finding.message]
    if finding.expected:
        parts.append(f"expected {', '.join(finding.expected)}")
    if finding.hint:
        parts.append(finding.hint)
    severity = _SEVERITY[finding.severity]
    return lsp.Diagnostic(range=_range(file, finding.span), message="\n".join(parts), severity=severity, code=finding.code, source="alula")


# --- places: the model counts characters from 1, the protocol UTF-16 units from 0 ---------------------------------------


def _units(text: str) -> int:
    return len(text.encode("utf-16-le", "surrogatepass")) // 2


def _position(file: ModelFile, line: int, column: int) -> lsp.Position:
    lines = file.text.split("\n")
    text = lines[line - 1] if 0 < line <= len(lines) else ""
    return lsp.Position(line=max(0, line - 1), character=_units(text[: max(0, column - 1)]))


def _range(file: ModelFile, span: Span) -> lsp.Range:
    return lsp.Range(start=_position(file, span.line, span.column), end=_position(file, span.line, span.end_column))


def _word_range(file: ModelFile, word: Word) -> lsp.Range:
    return lsp.Range(start=_position(file, word.line, word.column), end=_position(file, word.line, word.column + len(word.text)))


def _place(file: ModelFile, position: lsp.Position) -> Place:
    lines = file.text.split("\n")
    text = lines[position.line] if position.line < len(lines) else ""
    column = next((i for i in range(len(text) + 1) if _units(text[:i]) >= position.character), len(text))
    return Place(position.line + 1, column + 1)


if __name__ == "__main__":
    main()
