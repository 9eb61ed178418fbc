"""Problems with the text that they are about."""

from __future__ import annotations

from alula.trees.access import Access
from alula.trees.document import Attribute, Element
from alula.trees.errors import Problem


def of_element(code: str, element: Element, message: str, cure: str = "", *, warning: bool = False) -> Problem:
    """Return a problem of an element."""
    return Problem(element.place, message, cure, code, len(element.tag) + 1, warning)


def of_value(code: str, attribute: Attribute, message: str, cure: str = "", *, warning: bool = False) -> Problem:
    """Return a problem of an attribute's value."""
    place = attribute.value_place or attribute.place
    return Problem(place, message, cure, code, max(1, len(attribute.source) - 2), warning)


def in_value(code: str, attribute: Attribute, offsets: tuple[int, int], message: str, cure: str = "", *, warning: bool = False) -> Problem:
    """Return a problem of a part of an attribute's value: from the first offset to before the second, in characters."""
    place, end = attribute.place_of(offsets[0]), attribute.place_of(offsets[1])
    return Problem(place, message, cure, code, max(1, end.column - place.column) if end.line == place.line else 1, warning)


def of_access(access: Access, code: str, message: str, cure: str, *, warning: bool = False) -> Problem:
    """Return a problem of an access to an entry."""
    if access.offsets is None:
        return of_value(code, access.attribute, message, cure, warning=warning)
    return in_value(code, access.attribute, access.offsets, message, cure, warning=warning)
