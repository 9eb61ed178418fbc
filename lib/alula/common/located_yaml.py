"""YAML with places: every complaint names file and line."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

import yaml

from alula.common.errors import AlulaError
from alula.common.suggestions import nearest

MAX_CHARACTERS = 1_000_000
SHOWN_CHARACTERS = 40
"""Of a value that a message quotes: the message is one line, and the file may be any."""
MakeError = Callable[[str], Exception]


class YamlError(AlulaError):
    """A file is wrong; the message names the place, the error and the remedy."""


class Located:
    """A part of a YAML document.

    Args:
        path: of the document.
        node: the part.
        make_error: makes the exception of a complaint: the reader's own class.
        columns: complaints name the column, too.
    """

    def __init__(self, path: Path, node: yaml.Node, make_error: MakeError = YamlError, *, columns: bool = False) -> None:
        self._path = path
        self._node = node
        self._make_error = make_error
        self._columns = columns

    @property
    def place(self) -> str:
        """File and line, and the column where that is asked for, from 1."""
        mark = self._node.start_mark
        return f"{self._path}:{mark.line + 1}" + (f":{mark.column + 1}" if self._columns else "")

    def _part(self, node: yaml.Node) -> Located:
        return Located(self._path, node, self._make_error, columns=self._columns)

    def wrong(self, message: str) -> Exception:
        """Make a complaint about this part."""
        return self._make_error(f"{self.place}: {message}")

    @property
    def is_mapping(self) -> bool:
        """Return whether it has keys."""
        return isinstance(self._node, yaml.MappingNode)

    @property
    def is_list(self) -> bool:
        """Return whether it has elements."""
        return isinstance(self._node, yaml.SequenceNode)

    @property
    def value(self) -> object:
        """The part as plain values."""
        try:
            return yaml.constructor.SafeConstructor().construct_document(self._node)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise self.wrong(" ".join(str(error).split())) from None

    def entries(self, what: str) -> dict[str, Located]:
        """Return the parts of a mapping by key; raise where it is none, or has a key twice."""
        if not isinstance(self._node, yaml.MappingNode):
            raise self.wrong(f"{what} should be a mapping (`name: value`), not {_shown(self._node)}")
        found: dict[str, Located] = {}
        for key, value in self._node.value:
            name = str(key.value) if isinstance(key, yaml.ScalarNode) else ""
            if not name or name in found:
                raise self._part(key).wrong(f"{what}: `{name}` is given twice" if name else f"{what}: a key should be a word")
            found[name] = self._part(value)
        return found

    def record(self, what: str, known: Collection[str]) -> dict[str, Located]:
        """Return the parts of a mapping that may have these keys only."""
        found = self.entries(what)
        for name, part in found.items():
            if name not in known:
                raise part.wrong(f"{what} has no `{name}`; it may have {choices(name, known)}")
        return found

    def elements(self) -> list[Located]:
        """Return the elements of a list; anything else is a list of one."""
        if isinstance(self._node, yaml.SequenceNode):
            return [self._part(node) for node in self._node.value]
        return [self]

    def text(self, what: str) -> str:
        """Return a scalar's text; raises the document's error with file and line where there is a list or a mapping."""
        if not isinstance(self._node, yaml.ScalarNode):
            raise self.wrong(f"{what} should be one word or text, not {_shown(self._node)}")
        return str(self._node.value)

    def number(self, what: str, low: float, high: float = float("inf")) -> float:
        """Return a number within bounds; raise."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            bounds = f"from {low:g} to {high:g}" if high < float("inf") else f"from {low:g} on"
            raise self.wrong(f"{what} should be a number {bounds}, not {value!r}")
        return float(value)


def choices(name: str, known: Collection[str]) -> str:
    """Return the names that are allowed in the place of a wrong one, the nearest again at the end."""
    hint = nearest(name, known)
    return (", ".join(known) or "none") + (f" ({hint})" if hint.startswith("did") else "")


def read_yaml(path: Path, make_error: MakeError = YamlError, *, columns: bool = False) -> Located | None:
    """Read a document; None for an empty one; ``columns``: complaints name them.

    Raises:
        what ``make_error`` makes: the file can't be read, or is no YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
        if len(text) > MAX_CHARACTERS:
            raise make_error(f"{path}: {len(text)} characters are too many; {MAX_CHARACTERS} are allowed")
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        raise make_error(f"{path}: can't be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, RecursionError) as error:
        raise make_error(f"{path}: is no YAML text: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark is not None else ""
        problem = " ".join(str(getattr(error, "problem", None) or error).split())  # some of its messages have several lines
        raise make_error(f"{path}{line}: is no YAML: {problem}") from None
    return None if node is None else Located(path, node, make_error, columns=columns)


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        text = " ".join(node.value.split())
        return f"`{text if len(text) <= SHOWN_CHARACTERS else f'{text[:SHOWN_CHARACTERS]} …'}`"
    return "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"
