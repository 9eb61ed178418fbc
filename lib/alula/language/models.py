"""Files that are read together, the names that they use of each other, and every finding about each of them.

A skillset that says `use other` knows the types of skillset `other`, which is in one of the files, and those that are in
`other.skill` or `other.rl` beside its own file, within a skillset or outside.
"""

from __future__ import annotations

import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from alula.common.suggestions import nearest
from alula.language.check import MAX_FINDINGS, check
from alula.language.errors import Diagnostic, LanguageError, Severity
from alula.language.lexer import MAX_CHARACTERS, Source, tokenize
from alula.language.notation import SUFFIXES, Notation, read
from alula.language.roles import role_findings
from alula.language.syntax.document import Document, typed_elements, with_known_types
from alula.model.model import Skillset
from alula.model.span import Span

MAX_BYTES = 4 * MAX_CHARACTERS
STANDARD_INPUT = "<standard input>"


@dataclass
class ModelFile:
    """A file and what was found in it; ``document`` is None where there is no text to read."""

    path: str
    text: str = ""
    document: Document | None = None
    findings: list[Diagnostic] = field(default_factory=list)
    declared: tuple[Skillset, ...] = ()
    """The skillsets as they stand in the file: without the types that they know by `use`."""

    @property
    def skillsets(self) -> tuple[Skillset, ...]:
        """What could be read of the skillsets of the file."""
        return self.document.skillsets if self.document else ()

    @property
    def damaged(self) -> bool:
        """Something could not be read."""
        return self.document is None or self.document.damaged

    @cached_property
    def _lines(self) -> list[str]:
        return self.text.split("\n")

    def line(self, number: int) -> str:
        """Return a line of the text, 1-based; empty when there is none."""
        return self._lines[number - 1] if 0 < number <= len(self._lines) else ""

    def add(self, findings: Iterable[Diagnostic]) -> None:
        """Add findings (at most ``MAX_FINDINGS`` at a time), in the order of the source, each with the line that it is about."""
        found = [_with_line(finding, self._lines) for finding in islice(findings, MAX_FINDINGS)]
        self.findings = sorted((*self.findings, *found), key=lambda d: (d.span.line, d.span.column, d.code))


def check_files(paths: Sequence[str | Path], standard_input: BinaryIO | None = None) -> list[ModelFile]:
    """Read and check files together; all errors are findings, in the order of the source.

    ``-`` stands for the standard input where that is given.
    """
    streams = {"-": standard_input}
    return check_texts([_read_file(Path(path), str(path), streams.get(str(path))) for path in paths])


def models_in(path: str) -> list[str]:
    """Return the models of a folder in the order of their names; the path itself where it is none, or has none."""
    found = sorted(one for one in Path(path).glob("*") if one.suffix in SUFFIXES) if path != "-" else []
    return [str(one) for one in found] or [path]


def check_texts(files: Sequence[ModelFile], notation: Notation | None = None) -> list[ModelFile]:
    """Read and check files whose text is known already (those with findings are left as they are)."""
    for file in files:
        if not file.findings:
            file.document, source = read(file.text, file.path, notation)
            file.declared = file.document.skillsets
            file.findings += source.diagnostics
    _resolve(files)
    _report_duplicates(files)
    for file in files:
        file.add(_meaning(file))
        file.add(_roles(file, files))
    return list(files)


def read_text(path: Path) -> str:
    """Return a file's text with its line ends as newlines; raise LanguageError (ALU001 to ALU003) when it is no readable text."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise LanguageError([about(path, "ALU006", f"no {' or '.join(f'*{suffix}' for suffix in SUFFIXES)} file in this folder")])
        if not stat.S_ISREG(mode):
            raise LanguageError([about(path, "ALU001", "can't be read: it is no regular file; `-` reads the standard input")])
        with path.open("rb") as file:
            return _decoded(path, file.read(MAX_BYTES + 1))
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else "") or str(error)
        raise LanguageError([about(path, "ALU001", f"can't be read: {reason}")]) from error


def _decoded(path: Path, content: bytes) -> str:
    if len(content) > MAX_BYTES:
        raise LanguageError([about(path, "ALU003", f"more than {MAX_BYTES} bytes are too much for a model")])
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        message = f"not UTF-8 text: byte {error.start} is 0x{error.object[error.start]:02x}"
        raise LanguageError([about(path, "ALU002", message)]) from error


def about(path: Path, code: str, message: str) -> Diagnostic:
    """Return an error about a file as a whole."""
    return Diagnostic(code, message, Span(str(path), 0, 0, 0))


def _read_file(path: Path, name: str, stream: BinaryIO | None = None) -> ModelFile:
    if stream is not None:
        path, name = Path(STANDARD_INPUT), STANDARD_INPUT
    try:
        return ModelFile(name, read_text(path) if stream is None else _decoded(path, stream.read(MAX_BYTES + 1)))
    except LanguageError as error:
        return ModelFile(name, findings=list(error.diagnostics))


def _meaning(file: ModelFile) -> Iterator[Diagnostic]:
    """Yield findings about what could be read, as far as they can't come from what could not."""
    document = file.document
    if document is None or not document.whole:
        return
    for skillset in document.skillsets:
        for finding in check(skillset):
            # What seems unused or unknown may be in the part that is missing.
            if not document.damaged or (finding.severity is Severity.ERROR and finding.code != "ALU222"):
                yield finding
    first: dict[str, Span] = {}
    for shared in document.types:
        if shared.name in first:
            hint = f"it is declared in line {first[shared.name].line} first"
            yield Diagnostic("ALU201", f"type `{shared.name}` is declared twice", shared.span, hint=hint)
        first.setdefault(shared.name, shared.span)
    if not document.damaged and len(document.skillsets) > 1:
        used = {element.type for skillset in document.skillsets for element in typed_elements(skillset)}
        for shared in document.types:
            if shared.name not in used:
                yield Diagnostic("ALU303", f"type `{shared.name}` is never used", shared.span, Severity.WARNING)


# --- names across files ----------------------------------------------------------------------------------------------


def _resolve(files: Sequence[ModelFile]) -> None:
    """Give skillsets the types of those that they use; report what they use and isn't there."""
    known: dict[str, Skillset] = {}
    for file in files:
        for skillset in file.skillsets:
            known.setdefault(skillset.name, skillset)
    for file in files:
        if file.document is not None and any(skillset.uses for skillset in file.skillsets):
            resolved = tuple(_resolved(file, skillset, known) for skillset in file.skillsets)
            file.document = replace(file.document, skillsets=resolved)


def _report_duplicates(files: Sequence[ModelFile]) -> None:
    """Report skillsets of one name: an error in one folder, whose skillsets make one robot; a warning elsewhere."""
    first: dict[str, tuple[ModelFile, Span]] = {}
    for file in files:
        file.add(_defined_before(file, first))


def _defined_before(file: ModelFile, first: dict[str, tuple[ModelFile, Span]]) -> Iterator[Diagnostic]:
    """Yield a finding for each skillset of a file whose name is in ``first`` already; enter the others."""
    for skillset in file.skillsets:
        if skillset.name not in first:
            first[skillset.name] = (file, skillset.span)
            continue
        other, span = first[skillset.name]
        severity = Severity.ERROR if Path(other.path).parent == Path(file.path).parent else Severity.WARNING
        message = f"skillset `{skillset.name}` is defined in {span.file or other.path}, line {span.line}, already"
        yield Diagnostic("ALU404", message, skillset.span, severity, "name one of them otherwise")


def _roles(file: ModelFile, files: Sequence[ModelFile]) -> Iterator[Diagnostic]:
    """Yield what is wrong with a file's roles among all models of its folder, which make one robot; those not given are read."""
    named = [one for one in file.skillsets if any(skill.provides or skill.needs for skill in one.skills)]
    if not named or file.damaged:
        return
    folder = Path(file.path).parent
    given = {Path(one.path).name: one for one in files if Path(one.path).parent == folder}
    robot = [skillset for one in given.values() for skillset in one.skillsets]
    for path in sorted(one for one in folder.glob("*") if one.suffix in SUFFIXES and one.name not in given):
        with suppress(LanguageError):
            robot += read(read_text(path), str(path))[0].skillsets
    for skillset in named:
        yield from role_findings(skillset, robot)


def _resolved(file: ModelFile, skillset: Skillset, known: Mapping[str, Skillset]) -> Skillset:
    names: list[str] = []
    for use in skillset.uses:
        types = known[use].types if use in known else _beside(file, use)
        if types is None:
            message = f"`{skillset.name}` uses `{use}`, which is no skillset of these files, nor a file beside this one"
            hint = nearest(use, set(known) - {skillset.name})
            file.add([Diagnostic("ALU224", message, _use_place(file, skillset, use), hint=hint)])
        names += types or ()
    return with_known_types(skillset, names)


def _use_place(file: ModelFile, skillset: Skillset, name: str) -> Span:
    """Return where a skillset says that it uses another one."""
    source, using = Source(file.path, file.text), False
    for token in tokenize(source):
        if (token.line, token.column) <= (skillset.span.line, skillset.span.column):
            continue
        if using and token.text == name:
            return source.span(token)
        using = token.text == "use" or (using and token.text in {"{", ","})
    return skillset.span


def _beside(file: ModelFile, name: str) -> tuple[str, ...] | None:
    for suffix in SUFFIXES:
        path = Path(file.path).parent / f"{name}{suffix}"
        try:
            document, _ = read(read_text(path), str(path))
        except LanguageError:
            continue
        outside = tuple(kind.name for kind in document.types)
        return outside + tuple(kind for skillset in document.skillsets for kind in skillset.types)
    return None


def _with_line(finding: Diagnostic, lines: Sequence[str]) -> Diagnostic:
    line = finding.span.line
    return replace(finding, source_line=lines[line - 1]) if 0 < line <= len(lines) else finding
