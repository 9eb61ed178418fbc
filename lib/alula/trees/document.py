"""An XML file as data: elements and attributes with their places, and every character between them, so that it can be written again.

What makes XML dangerous is refused: a document type and so any entity of one's own, nesting and size beyond what a mission can need.
"""

from __future__ import annotations

import html
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from alula.trees.errors import FileError, Place, Problem

DEEPEST = 256
"""Levels of nesting in one file; BehaviorTree.CPP has the same limit."""
LONGEST_BYTES = 16 << 20
MOST_ELEMENTS = 30_000
ATTRIBUTE = re.compile(rb"""(\s+)([^\s=/>]+)(\s*=\s*)("[^"]*"|'[^']*')""")
CHARACTER = re.compile(r"&#?\w+;|\r\n|.", re.DOTALL)
AMPERSAND = re.compile(rb"&(?!#?\w+;)")
"""One that stands for itself."""
ENTITY, BREAK = re.compile(r"&#?\w+;"), re.compile(r"\r\n|[\r\n\t]")
LESS = re.compile(rb"<")
DASHES = re.compile(rb"-(?=-)|-\Z")
"""In a comment; the last one stands before its end."""
DECLARATION = re.compile(rb"\s+(<\?xml[^>]*\?>)")
_ESCAPED = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\t": "&#9;", "\r": "&#13;"})
"""How an attribute's value has to be written; xml.sax.saxutils would take the network's modules along."""
_UNCLOSED = {expat.errors.codes[message] for message in (expat.errors.XML_ERROR_TAG_MISMATCH, expat.errors.XML_ERROR_NO_ELEMENTS)}
_AMPERSAND = "an `&` that stands for itself is no XML, so other tools refuse the file", "write &amp;"
_LESS = "a `<` in an attribute is no XML, so other tools refuse the file", "write &lt;"
_DASHES = "a comment with `--` in it is no XML, so other tools refuse the file", "write other signs than dashes there"
_BLANK = "something stands before `<?xml`, so other tools refuse the file", "begin the file with `<?xml`"
TAG = re.compile(rb"<[A-Za-z_][^\s=/>]*")


def quoted(value: str) -> str:
    """Return an attribute's value as a file has it, with its quotation marks."""
    return f'"{value.translate(_ESCAPED)}"'


@dataclass
class Attribute:
    """An attribute; ``place`` is that of its name."""

    name: str
    value: str
    place: Place
    lead: str = " "
    """What stands before it."""
    sign: str = "="
    source: str = ""
    """The value as the file has it, with its quotes; empty when it was set later."""
    value_place: Place | None = None

    def place_of(self, offset: int) -> Place:
        """Return the place of a character of the value."""
        start = self.value_place or self.place
        line, column = start.line, start.column
        for number, character in enumerate(CHARACTER.finditer(self.source[1:-1])):
            if number == offset:
                break
            broken = character.group() in {"\n", "\r\n"}
            line, column = (line + 1, 1) if broken else (line, column + len(character.group()))
        return Place(start.path, line, column)

    def text(self) -> str:
        """Return it as it stands in a file."""
        value = self.source or quoted(self.value)
        return f"{self.lead}{self.name}{self.sign}{value}"


@dataclass
class Element:
    """An element; ``content`` is what stands in it: elements, and all else as the file has it (text, comments)."""

    tag: str
    place: Place
    attributes: dict[str, Attribute] = field(default_factory=dict)
    content: list[Element | str] = field(default_factory=list)
    tail: str = ""
    """What stands before the end of its first tag."""
    empty: bool = False
    closing: str = ""

    @property
    def children(self) -> list[Element]:
        """The elements in it."""
        return [part for part in self.content if isinstance(part, Element)]

    def get(self, name: str, default: str = "") -> str:
        """Return the value of an attribute."""
        attribute = self.attributes.get(name)
        return default if attribute is None else attribute.value

    def set(self, name: str, value: str) -> None:
        """Change an attribute, or add one behind the others."""
        known = self.attributes.get(name)
        if known is None:
            self.attributes[name] = Attribute(name, value, self.place)
        else:
            known.value, known.source = value, ""

    def place_of(self, attribute: str) -> Place:
        """Return the place of an attribute, that of the element where it has none of that name."""
        known = self.attributes.get(attribute)
        return self.place if known is None else known.place

    def iterate(self) -> Iterator[Element]:
        """Yield the element and all below it, in the order of the file."""
        left = [self]
        while left:
            element = left.pop()
            yield element
            left.extend(reversed(element.children))

    def pieces(self) -> Iterator[str]:
        """Yield its text."""
        yield f"<{self.tag}" + "".join(attribute.text() for attribute in self.attributes.values()) + self.tail
        if self.empty and not self.content:
            yield "/>"
            return
        yield ">"
        for part in self.content:
            if isinstance(part, str):
                yield part
            else:
                yield from part.pieces()
        yield self.closing or f"</{self.tag}>"


@dataclass
class Document:
    """A file; ``path`` is how messages call it."""

    path: str
    root: Element
    before: str = ""
    after: str = ""
    slips: tuple[Problem, ...] = ()
    """What is no XML in it, and was read all the same: warnings."""

    def text(self) -> str:
        """Return the file's text: what it was read from, with what has been changed since."""
        return self.before + "".join(self.root.pieces()) + self.after


def read_source(path: Path) -> bytes:
    """Return what a file has, of one that is too long its beginning; raises FileError."""
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise FileError(Problem(Place(str(path), 1, 1), "can't be read: it is no regular file", code="ALU001"))
        with path.open("rb") as file:
            return file.read(LONGEST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else "") or str(error)
        raise FileError(Problem(Place(str(path), 1, 1), f"can't be read: {reason}", code="ALU001")) from error


def read_document(path: Path) -> Document:
    """Read a file; raises FileError."""
    return parse_document(read_source(path), str(path))


def parse_document(content: str | bytes, path: str = "<text>") -> Document:
    """Read the text of a file, UTF-8; raises FileError."""
    source = content.encode() if isinstance(content, str) else content
    mark = b"\xef\xbb\xbf" if source.startswith(b"\xef\xbb\xbf") else b""
    text = source[len(mark) :]
    try:
        return _Parser(text, path).document(mark.decode())
    except FileError:
        plain = _Plain(text)
        if plain.text == text:
            raise
    return _Parser(text, path, plain).document(mark.decode())


class _Plain:
    """A text of the same length without what is no XML, and what BehaviorTree.CPP's reader takes all the same.

    Files of the field have `&` and `<` that stand for themselves in attributes, as in ``a < b && c``, comments that are made of
    dashes, and a blank line before `<?xml`. ``slips``: the first of each, as its index, what it is, and the cure.
    """

    def __init__(self, source: bytes) -> None:
        self.slips: list[tuple[int, str, str]] = []
        self._source = source
        self._plain = bytearray(source)
        self._declaration()
        index = 0
        while 0 <= index < len(source):
            start, index = index, source.find(b"<", index)
            self._mend((start, len(source) if index < 0 else index), AMPERSAND, _AMPERSAND)
            if index >= 0:
                index = self._comment(index) if source.startswith(b"<!--", index) else self._tag(index)
        self.text = bytes(self._plain)

    def _declaration(self) -> None:
        match = DECLARATION.match(self._source)
        if match is not None:
            self._plain[: match.end()] = re.sub(rb"[^\n]", b" ", match[0])
            self._note(match.start(1), _BLANK)

    def _comment(self, index: int) -> int:
        end = self._source.find(b"-->", index + 4)
        if end >= 0:
            self._mend((index + 4, end), DASHES, _DASHES)
        return end + 3 if end >= 0 else -1

    def _tag(self, index: int) -> int:
        end = index + 1
        if match := TAG.match(self._source, index):
            end = match.end()
            while match := ATTRIBUTE.match(self._source, end):
                self._mend(match.span(4), AMPERSAND, _AMPERSAND)
                self._mend(match.span(4), LESS, _LESS)
                end = match.end()
        return self._source.find(b">", end)

    def _mend(self, span: tuple[int, int], pattern: re.Pattern[bytes], slip: tuple[str, str]) -> None:
        for match in pattern.finditer(self._source, *span):
            self._plain[match.start() : match.end()] = b"_" * len(match[0])
            self._note(match.start(), slip)

    def _note(self, index: int, slip: tuple[str, str]) -> None:
        if slip not in [(message, cure) for _, message, cure in self.slips]:
            self.slips.append((index, *slip))


class _Parser:
    """Builds the elements while expat goes through the file; a stack, so that no nesting harms."""

    def __init__(self, source: bytes, path: str, plain: _Plain | None = None) -> None:
        self._source = source
        self._plain = source if plain is None else plain.text
        self._slips = [] if plain is None else plain.slips
        self._path = path
        self._lines = [0, *(match.end() for match in re.finditer(rb"\n", source))]
        self._open: list[Element] = []
        self._root: Element | None = None
        self._count = 0
        self._written = 0  # up to where the source is in the elements
        self._before = 0
        self._last = -1, 1  # the place that was told last: its index, its column
        parser = self._expat = expat.ParserCreate("utf-8")
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._doctype

    def document(self, mark: str) -> Document:
        if len(self._source) > LONGEST_BYTES:
            raise self._error(0, f"is longer than {LONGEST_BYTES >> 20} MB")
        try:
            self._source.decode()
        except UnicodeDecodeError as error:
            raise self._error(error.start, "is not UTF-8", "save it as UTF-8") from error
        try:
            self._expat.Parse(self._plain, True)
        except expat.ExpatError as error:
            raise self._error(self._expat.ErrorByteIndex, f"is no XML: {expat.ErrorString(error.code)}", self._closing(error)) from error
        if self._root is None:
            raise self._error(0, "is empty")
        before, after = self._source[: self._before].decode(), self._source[self._written :].decode()
        slips = [Problem(self._place(index), message, cure, "ALU619", warning=True) for index, message, cure in self._slips]
        return Document(self._path, self._root, mark + before, after, tuple(slips))

    def _closing(self, error: expat.ExpatError) -> str:
        """Return which tag is missing where the tags do not match, or the file ends before the last one."""
        if not self._open or error.code not in _UNCLOSED:
            return ""
        element = self._open[-1]
        return f"close <{element.tag}> of line {element.place.line} first, with </{element.tag}>"

    def _place(self, index: int) -> Place:
        line = bisect_right(self._lines, index)
        start, column = self._lines[line - 1], 1
        if start <= self._last[0] <= index:  # on from the place before: a file may have one line of megabytes
            start, column = self._last
        column += len(self._source[start:index].decode(errors="replace"))
        self._last = index, column
        return Place(self._path, line, column)

    def _error(self, index: int, message: str, cure: str = "") -> FileError:
        return FileError(Problem(self._place(max(index, 0)), message, cure))

    def _doctype(self, *_: object) -> None:
        raise self._error(self._expat.CurrentByteIndex, "has a document type (<!DOCTYPE>)", "take it out: a tree needs no entities")

    def _start(self, tag: str, values: dict[str, str]) -> None:
        index = self._expat.CurrentByteIndex
        self._count += 1
        if len(self._open) >= DEEPEST:
            raise self._error(index, f"is nested deeper than {DEEPEST} levels", "make subtrees of its parts")
        if self._count > MOST_ELEMENTS:
            raise self._error(index, f"has more than {MOST_ELEMENTS} elements")
        element = Element(tag, self._place(index))
        end = self._attributes(element, values, index + 1 + len(tag.encode()))
        close = self._source.index(b">", end)
        element.empty = self._source[close - 1 : close] == b"/"
        element.tail = self._source[end : close - element.empty].decode()
        self._between(index, close + 1)
        if self._open:
            self._open[-1].content.append(element)
        else:
            self._root, self._before = element, index
        self._open.append(element)

    def _attributes(self, element: Element, values: dict[str, str], index: int) -> int:
        while match := ATTRIBUTE.match(self._source, index):
            lead, raw_name, sign, source = match.groups()
            name = raw_name.decode()
            places = self._place(match.start(2)), self._place(match.start(4) + 1)
            value = values[name]
            if self._plain[match.start(4) : match.end(4)] != source:
                value = ENTITY.sub(lambda one: html.unescape(one[0]), BREAK.sub(" ", source.decode()[1:-1]))
            element.attributes[name] = Attribute(name, value, places[0], lead.decode(), sign.decode(), source.decode(), places[1])
            index = match.end()
        return index

    def _end(self, _tag: str) -> None:
        element = self._open.pop()
        if not element.empty:
            index = self._expat.CurrentByteIndex
            close = self._source.index(b">", index) + 1
            self._open.append(element)
            self._between(index, close)
            self._open.pop()
            element.closing = self._source[index:close].decode()

    def _between(self, index: int, end: int) -> None:
        """Give what stands up to a tag to the element that is open; the tag itself ends at ``end``."""
        if self._open and index > self._written:
            self._open[-1].content.append(self._source[self._written : index].decode())
        self._written = end
