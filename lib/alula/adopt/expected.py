"""What conditions answer where all goes well, as far as trees show it: for mocks to begin with."""

from __future__ import annotations

from collections.abc import Iterable

from alula.adopt.vocabulary import FAILS, HOLDS, Vocabulary
from alula.trees.attributes import type_name
from alula.trees.document import Element

FALLBACKS = frozenset({"Fallback", "ReactiveFallback", "AsyncFallback"})
INVERTER = "Inverter"


def expected_states(trees: Iterable[Element], vocabulary: Vocabulary) -> dict[str, str]:
    """Return for each resource the state with which its first use lets the tree go on.

    A condition holds; below an Inverter it does not; and one before the last child of a Fallback does not, so that what is to be done about
    it is done.
    """
    found: dict[str, str] = {}

    def visit(element: Element, *, wanted: bool) -> None:
        kind, children = type_name(element), element.children
        resource = vocabulary.resource(element)
        if resource is not None:
            found.setdefault(resource.name, HOLDS if wanted else FAILS)
        for child in children:
            is_tried = kind in FALLBACKS and child is not children[-1]
            visit(child, wanted=wanted != (kind == INVERTER or is_tried))

    for tree in trees:
        for top in tree.children:
            visit(top, wanted=True)
    return {one.name: found[one.name] for one in vocabulary.resources.values()}
