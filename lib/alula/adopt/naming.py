"""Names of a robot for the names that trees have: lower case with underscores, and each of them once."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Iterable

HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
OTHERS = re.compile(r"[^A-Za-z0-9]+")
_LANGUAGE = """
    after all always and apply assuming client data deadline effect event eventually extern failure false for guard id initial input
    interrupt interrupting invariant leads message name never not or output parameter period post postcondition precondition progress
    property recovers resource result running sec silence skill skillset start state success termination timeout to transition true type
    use violation
"""
_PORTS = "execution halt_waits outcome self"
RESERVED = frozenset({*_LANGUAGE.split(), *_PORTS.split(), *(word.lower() for word in (*keyword.kwlist, *keyword.softkwlist))})
"""Words of the language, of Python, and of what every skill has."""


def snake(text: str) -> str:
    """Return a text in lower case, with underscores between its words; empty where it has no letter or digit of ASCII."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return OTHERS.sub("_", HUMP.sub("_", plain)).strip("_").lower()


class Names:
    """Names that are given once each; ``kind`` is added to a reserved word, and before what does not begin with a letter.

    Two names that differ in underscores only are one: code that is generated of them has both in camel case.
    """

    def __init__(self, kind: str, taken: Iterable[str] = ()) -> None:
        self._kind = kind
        self._taken = {name.replace("_", "") for name in taken}

    def add(self, text: str) -> str:
        """Return the name for a text: a number is added where it is taken."""
        base = snake(text)
        if not base[:1].isalpha():
            base = f"{self._kind}_{base}".strip("_")
        if base in RESERVED:
            base = f"{base}_{self._kind}"
        name, number = base, 1
        while name.replace("_", "") in self._taken:
            number += 1
            name = f"{base}_{number}"
        self._taken.add(name.replace("_", ""))
        return name
