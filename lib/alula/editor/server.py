"""`alula editor`: a language server over the standard streams, for editors.

It publishes the checker's findings on every change and the proofs' when a file is saved, completes, shows and renames names, finds where
they are defined and used, lists symbols, indents, and offers the hints of findings as changes. Of missions (*.xml) it does
so with the trees of the whole folder, too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from alula.editor import names
from alula.editor.completion import Completion, Place, completions
from alula.editor.missions import SUFFIX, Missions
from alula.editor.occurrences import Occurrence
from alula.editor.tree_names import TreeFolder, TreeName
from alula.language.check.fields import check_fields
from alula.language.errors import Diagnostic, Severity, has_errors
from alula.language.layout import formatted
from alula.language.lexer import MAX_CHARACTERS
from alula.language.models import ModelFile, check_texts, models_in
from alula.model.span import Span

PROOFS_S = 10.0
"""How long the proofs of a saved file may take."""

_SEVERITY = {
    Severity.ERROR: lsp.DiagnosticSeverity.Error,
    Severity.WARNING: lsp.DiagnosticSeverity.Warning,
    Severity.NOTE: lsp.DiagnosticSeverity.Information,
}
_COMPLETION_KIND = {
    "state": lsp.CompletionItemKind.EnumMember,
    "resource": lsp.CompletionItemKind.Enum,
    "skill": lsp.CompletionItemKind.Function,
    "effect": lsp.CompletionItemKind.Event,
    "role": lsp.CompletionItemKind.Interface,
    "data": lsp.CompletionItemKind.Variable,
    "type": lsp.CompletionItemKind.Class,
    "keyword": lsp.CompletionItemKind.Keyword,
}
_SYMBOL_KIND = {
    "skillset": lsp.SymbolKind.Module,
    "resource": lsp.SymbolKind.Enum,
    "skill": lsp.SymbolKind.Function,
    "event": lsp.SymbolKind.Event,
    "data": lsp.SymbolKind.Variable,
    "input": lsp.SymbolKind.Variable,
    "invariant": lsp.SymbolKind.Property,
    "property": lsp.SymbolKind.Property,
    "result": lsp.SymbolKind.EnumMember,
}


class SkillLanguageServer(LanguageServer):
    """Keeps what was read of each open document until it changes."""

    def __init__(self) -> None:
        super().__init__("alula-skill-language", "0.3.0", text_document_sync_kind=lsp.TextDocumentSyncKind.Incremental)
        self._files: dict[str, tuple[int | None, ModelFile]] = {}
        self.missions = Missions()

    def file(self, uri: str) -> ModelFile | None:
        """Return a document as the editor has it, read and checked; None when it is not open."""
        document = self.workspace.text_documents.get(uri)
        if document is None:
            self._files.pop(uri, None)
            return None
        known = self._files.get(uri)
        if known is None or known[0] != document.version:
            path, text = self._text(uri)
            file = self.missions.checked(path, text, self.opened()) if is_mission(uri) else _checked(ModelFile(path, text))
            known = self._files[uri] = (document.version, file)
        return known[1]

    def opened(self) -> dict[Path, tuple[object, str]]:
        """Return the missions that are open, by their paths, each with its version and text."""
        missions = [(uri, one) for uri, one in self.workspace.text_documents.items() if is_mission(uri)]
        return {Path(path): (one.version, self._text(uri)[1]) for uri, one in missions if (path := to_fs_path(uri))}

    def model_file(self, path: str) -> tuple[str, ModelFile]:
        """Return the URI and the text of a file, as the editor or else the disk has it."""
        uri = from_fs_path(path) or path
        return uri, ModelFile(*self._text(uri))

    def robot(self, uri: str) -> dict[str, ModelFile]:
        """Return all models of a document's folder by their URI, as the editor or else the disk has them, read together."""
        texts = {uri: ModelFile(*self._text(uri))}
        place = to_fs_path(uri)
        for path in models_in(str(Path(place).parent)) if place else ():
            other = from_fs_path(path)
            if other and other != uri and Path(path).is_file():
                texts[other] = ModelFile(*self._text(other))
        return dict(zip(texts, check_texts(list(texts.values())), strict=True))

    def _text(self, uri: str) -> tuple[str, str]:
        """Return the path and the text of a document, whether it is open or not."""
        source = self.workspace.get_text_document(uri).source[: MAX_CHARACTERS + 1]
        return to_fs_path(uri) or Path(uri).name, source.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


def _checked(file: ModelFile) -> ModelFile:
    check_texts([file])
    check_fields(file)
    return file


def is_mission(uri: str) -> bool:
    """Return whether a document is a mission: all others are models."""
    return uri.endswith(SUFFIX)


server = SkillLanguageServer()


@dataclass(frozen=True)
class _Asked:
    """The document and the name that a request is about."""

    uri: str
    file: ModelFile
    name: Occurrence


def _asked(ls: SkillLanguageServer, document: lsp.TextDocumentIdentifier, position: lsp.Position) -> _Asked | None:
    file = ls.file(document.uri)
    if file is None or is_mission(document.uri):
        return None
    place = _place(file, position)
    found = names.occurrence_at(file, place.line, place.column)
    return None if found is None else _Asked(document.uri, file, found)


def _files_that_know(ls: SkillLanguageServer, asked: _Asked) -> dict[str, ModelFile]:
    """Return the files in which a name stands for the same, by their URI: of what a robot's files share, all models of its folder."""
    return ls.robot(asked.uri) if asked.name.entity.kind in names.SHARED else {asked.uri: asked.file}


def _asked_in_trees(
    ls: SkillLanguageServer, document: lsp.TextDocumentIdentifier, position: lsp.Position
) -> tuple[TreeFolder, TreeName] | None:
    """Return the name of a tree, a node or an entry in a mission that a request is about, with the trees around the file."""
    file = ls.file(document.uri) if is_mission(document.uri) else None
    if file is None:
        return None
    folder, place = ls.missions.folder(file.path, ls.opened()), _place(file, position)
    found = folder.at(Path(file.path), place.line, place.column)
    return None if found is None else (folder, found)


def _location(ls: SkillLanguageServer, span: Span) -> lsp.Location:
    uri, file = ls.model_file(span.file)
    return lsp.Location(uri=uri, range=_range(file, span))


# --- findings ---------------------------------------------------------------------------------------------------------


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
def did_open(ls: SkillLanguageServer, params: lsp.DidOpenTextDocumentParams) -> None:
    """Publish the findings of a file that was opened."""
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
def did_change(ls: SkillLanguageServer, params: lsp.DidChangeTextDocumentParams) -> None:
    """Publish the findings of a file that was changed."""
    _publish(ls, params.text_document.uri)


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
def did_close(ls: SkillLanguageServer, params: lsp.DidCloseTextDocumentParams) -> None:
    """Withdraw the findings of a file."""
    ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri=params.text_document.uri, diagnostics=[]))


@server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
@server.thread()
def did_save(ls: SkillLanguageServer, params: lsp.DidSaveTextDocumentParams) -> None:
    """Prove a file that was saved; publish the findings unless it has changed meanwhile."""
    # The solvers are loaded only for a proof.
    from alula.prove.skillset.prover import prove

    uri = params.text_document.uri
    file = ls.file(uri)
    if file is None or file.damaged or has_errors(file.findings):
        return
    found = [finding for skillset in file.skillsets for finding in prove(skillset, timeout_s=PROOFS_S)]
    if ls.file(uri) is file:
        _publish(ls, uri, found)


def _publish(ls: SkillLanguageServer, uri: str, proved: list[Diagnostic] | None = None) -> None:
    file = ls.file(uri)
    if file is not None:
        told = [_diagnostic(file, finding) for finding in (*file.findings, *(proved or ()))]
        ls.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri=uri, diagnostics=told))


def _diagnostic(file: ModelFile, finding: Diagnostic) -> lsp.Diagnostic:
    parts = [finding.message]
    if finding.expected:
        parts.append(f"expected {', '.join(finding.expected)}")
    parts += finding.counterexample_lines
    if finding.hint:
        parts.append(finding.hint)
    severity = _SEVERITY[finding.severity]
    return lsp.Diagnostic(range=_range(file, finding.span), message="\n".join(parts), severity=severity, code=finding.code, source="alula")


# --- names ------------------------------------------------------------------------------------------------------------


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=[" ", "=", ">", ":", "<", ".", "(", '"']))
def completion(ls: SkillLanguageServer, params: lsp.CompletionParams) -> lsp.CompletionList:
    """Return the names that may stand at the cursor."""
    file = ls.file(params.text_document.uri)
    found: list[Completion] = []
    if file is not None:
        place = _place(file, params.position)
        found = ls.missions.completions(file, place, ls.opened()) if is_mission(params.text_document.uri) else completions(file, place)
    items = [lsp.CompletionItem(label=c.label, kind=_COMPLETION_KIND[c.kind], detail=c.detail or None) for c in found]
    return lsp.CompletionList(is_incomplete=False, items=items)


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
def hover(ls: SkillLanguageServer, params: lsp.HoverParams) -> lsp.Hover | None:
    """Return what the name under the pointer stands for."""
    if is_mission(params.text_document.uri):
        return _hover_in_mission(ls, params)
    asked = _asked(ls, params.text_document, params.position)
    text = names.description(asked.file, asked.name.entity) if asked else ""
    if asked is None or not text:
        return None
    contents = lsp.MarkupContent(kind=lsp.MarkupKind.Markdown, value=f"```skill\n{text}\n```")
    return lsp.Hover(contents=contents, range=_range(asked.file, asked.name.span))


def _hover_in_mission(ls: SkillLanguageServer, params: lsp.HoverParams) -> lsp.Hover | None:
    file = ls.file(params.text_document.uri)
    place = _place(file, params.position) if file else None
    found = ls.missions.description(file, place) if file and place else None
    if file is None or place is None or found is None:
        return None
    text, first, end = found
    contents = lsp.MarkupContent(kind=lsp.MarkupKind.Markdown, value=f"```skill\n{text}\n```")
    return lsp.Hover(contents=contents, range=_range(file, Span(file.path, place.line, first, end)))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
def go_to_definition(ls: SkillLanguageServer, params: lsp.DefinitionParams) -> lsp.Location | None:
    """Return where the name under the pointer is defined."""
    if (in_trees := _asked_in_trees(ls, params.text_document, params.position)) is not None:
        place = in_trees[0].definition(in_trees[1])
        return None if place is None else _location(ls, place)
    asked = _asked(ls, params.text_document, params.position)
    if asked is None:
        return None
    found = ((uri, file, names.definition(file, asked.name.entity)) for uri, file in _files_that_know(ls, asked).items())
    return next((lsp.Location(uri=uri, range=_range(file, span)) for uri, file, span in found if span is not None), None)


@server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
def find_references(ls: SkillLanguageServer, params: lsp.ReferenceParams) -> list[lsp.Location]:
    """Return all places of what the name under the pointer stands for."""
    if (in_trees := _asked_in_trees(ls, params.text_document, params.position)) is not None:
        uses = in_trees[0].uses(in_trees[1])
        return [_location(ls, one.span) for one in uses if params.context.include_declaration or not one.defining]
    asked = _asked(ls, params.text_document, params.position)
    if asked is None:
        return []
    several = _files_that_know(ls, asked).items()
    found = [(uri, file, one) for uri, file in several for one in names.references(file, asked.name.entity)]
    wanted = [one for one in found if params.context.include_declaration or not one[2].defining]
    return [lsp.Location(uri=uri, range=_range(file, one.span)) for uri, file, one in wanted]


@server.feature(lsp.TEXT_DOCUMENT_RENAME)
def rename(ls: SkillLanguageServer, params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
    """Return the changes that give the name under the pointer another one."""
    if (in_trees := _asked_in_trees(ls, params.text_document, params.position)) is not None:
        return _renamed_in_trees(ls, *in_trees, params.new_name)
    asked = _asked(ls, params.text_document, params.position)
    if asked is None:
        return None
    entity, name = asked.name.entity, params.new_name
    files = _files_that_know(ls, asked)
    try:
        places = names.renamed(list(files.values()), entity, name)
    except names.RenameError as error:
        raise JsonRpcInvalidParams(str(error)) from error
    changed = {uri: (file, places[file.path]) for uri, file in files.items() if file.path in places}
    edits = {uri: [lsp.TextEdit(_range(file, one), name) for one in spans] for uri, (file, spans) in changed.items()}
    return lsp.WorkspaceEdit(changes=edits | (_types_renamed(asked.uri, entity.name, name) if entity.kind == "type" else {}))


def _renamed_in_trees(ls: SkillLanguageServer, folder: TreeFolder, asked: TreeName, name: str) -> lsp.WorkspaceEdit:
    try:
        changes = folder.renamed(asked, name)
    except names.RenameError as error:
        raise JsonRpcInvalidParams(str(error)) from error
    edits: dict[str, list[lsp.TextEdit]] = {}
    for path, places in changes.items():
        uri, file = ls.model_file(path)
        edits[uri] = [lsp.TextEdit(_range(file, span), text) for span, text in places]
    return lsp.WorkspaceEdit(changes=edits)


def _types_renamed(uri: str, before: str, after: str) -> dict[str, list[lsp.TextEdit]]:
    """Return the change of the folder's ``types.yaml``, which has an entry a type."""
    place = Path(to_fs_path(uri) or "").with_name("types.yaml")
    types_uri = from_fs_path(str(place))
    if types_uri is None or not place.is_file():
        return {}
    lines = place.read_text(encoding="utf-8").splitlines()
    numbers = [number for number, line in enumerate(lines) if re.match(rf"{re.escape(before)}\s*:", line)]
    entries = [lsp.Range(lsp.Position(number, 0), lsp.Position(number, len(before))) for number in numbers]
    return {types_uri: [lsp.TextEdit(entry, after) for entry in entries]} if entries else {}


@server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
def document_symbols(ls: SkillLanguageServer, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """Return the outline of a file."""
    file = ls.file(params.text_document.uri)
    return [] if file is None else [_symbol(file, one) for one in names.symbols(file)]


def _symbol(file: ModelFile, symbol: names.Symbol) -> lsp.DocumentSymbol:
    place = _range(file, symbol.span)
    children = [_symbol(file, one) for one in symbol.children]
    # An outline wants a part within its whole; the names' places are all that is known.
    whole = lsp.Range(start=place.start, end=max([place.end, *(c.range.end for c in children)], key=lambda p: (p.line, p.character)))
    kind = _SYMBOL_KIND[symbol.kind]
    return lsp.DocumentSymbol(symbol.name or "?", kind, whole, place, detail=symbol.detail or None, children=children)


# --- changes of the text ------------------------------------------------------------------------------------------------


@server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
def formatting(ls: SkillLanguageServer, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
    """Indent a file by its braces."""
    file = ls.file(params.text_document.uri)
    if file is None or is_mission(params.text_document.uri) or formatted(file.text) == file.text:
        return []
    lines = file.text.split("\n")
    return [lsp.TextEdit(lsp.Range(lsp.Position(0, 0), _position(file, len(lines), len(lines[-1]) + 1)), formatted(file.text))]


_DID_YOU_MEAN = re.compile(r"did you mean `(\w+)`\?")
_DECLARE = re.compile(r"declare it with `(type \w+)`")


@server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix]))
def code_actions(ls: SkillLanguageServer, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """Return code actions for the findings in a range whose hints have text to insert."""
    uri = params.text_document.uri
    file = ls.file(uri)
    if file is None:
        return []
    first, last = params.range.start.line + 1, params.range.end.line + 1
    found = [finding for finding in file.findings if first <= finding.span.line <= last]
    edits = [(finding, *edit) for finding in found if (edit := _mended(file, finding)) is not None]
    return [
        lsp.CodeAction(
            title, lsp.CodeActionKind.QuickFix, diagnostics=[_diagnostic(file, finding)], edit=lsp.WorkspaceEdit(changes={uri: [edit]})
        )
        for finding, title, edit in edits
    ]


def _mended(file: ModelFile, finding: Diagnostic) -> tuple[str, lsp.TextEdit] | None:
    """Return what a hint would have changed, and its title."""
    declared = _DECLARE.search(finding.hint)
    if declared:
        return f"Add `{declared[1]}`", lsp.TextEdit(lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0)), f"{declared[1]}\n")
    meant = _DID_YOU_MEAN.search(finding.hint)
    line = finding.source_line
    if meant is None or not line:
        return None
    for wrong in reversed(re.findall(r"`(\w+)`", finding.message)):
        match = re.compile(rf"\b{re.escape(wrong)}\b").search(line, max(0, finding.span.column - 1))
        if match and match.start() < max(finding.span.end_column, finding.span.column + 1):
            span = Span(file.path, finding.span.line, match.start() + 1, match.end() + 1)
            return f"Change `{wrong}` to `{meant[1]}`", lsp.TextEdit(_range(file, span), meant[1])
    return None


def serve(*, trusted: bool = False) -> None:
    """Serve until the editor goes; ``trusted``: robots' Python may be imported."""
    server.missions.trusted = trusted
    server.start_io()


# --- places: the model counts characters from 1, the protocol UTF-16 units from 0 ---------------------------------------


def _units(text: str) -> int:
    return len(text.encode("utf-16-le", "surrogatepass")) // 2


def _position(file: ModelFile, line: int, column: int) -> lsp.Position:
    text = file.line(line)
    return lsp.Position(line=max(0, line - 1), character=_units(text[: max(0, column - 1)]))


def _range(file: ModelFile, span: Span) -> lsp.Range:
    return lsp.Range(start=_position(file, span.line, span.column), end=_position(file, span.line, span.end_column))


def _place(file: ModelFile, position: lsp.Position) -> Place:
    text = file.line(position.line + 1)
    column = next((i for i in range(len(text) + 1) if _units(text[:i]) >= position.character), len(text))
    return Place(position.line + 1, column + 1)
