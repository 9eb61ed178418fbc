"""Files of BehaviorTree.CPP 3: what shows that a file is one, and its conversion to format 4, with what a person has to decide.

Source: BehaviorTree.CPP 3.8 (`xml_parsing.cpp`, `parallel_node.cpp`, `blackboard_precondition.h`), and its guide for the migration to 4.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace

from alula.trees.attributes import AUTOREMAP
from alula.trees.document import Attribute, Document, Element
from alula.trees.errors import Problem
from alula.trees.node_type import CATEGORIES

FORMAT, OLD = "4", "3"
DECLARED = "BTCPP_format"
TAGS = {
    "SubTreePlus": "SubTree",
    "SequenceStar": "SequenceWithMemory",
    "FallbackStar": "Fallback",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
}
"""Nodes by another name."""
THRESHOLDS = {"success_threshold": "success_count", "failure_threshold": "failure_count", "threshold": "success_count"}
"""Ports of Parallel."""
CHECKS = ("BlackboardCheckInt", "BlackboardCheckDouble", "BlackboardCheckBool", "BlackboardCheckString")
SHARED, OLD_AUTOREMAP = "__shared_blackboard", "__autoremap"
NEW_TAGS = frozenset({"Script", "ScriptCondition", "SequenceWithMemory", "Precondition"})
ENTRY = re.compile(r"[A-Za-z_]\w*")
BRACES = re.compile(r"\s*\$?\{\s*(.*?)\s*\}\s*")
NUMBER = re.compile(r"\s*[-+]?\d+(?:\.\d*)?\s*")
WORDS = frozenset({"true", "false"})


def modernised(document: Document) -> Document:
    """Return a document as one of format 4, as it is where it is one; that it was none is one of its slips."""
    root = document.root
    if root.tag != "root" or (DECLARED in root.attributes and root.get(DECLARED) != OLD):
        return document
    trees = [one for one in root.children if one.tag == "BehaviorTree"]
    mark = root.attributes.get(DECLARED) or next(_marks(trees), None)
    if mark is None:
        cure = f'write <root {DECLARED}="{FORMAT}"'
        slip = Problem(root.place, f"<root> has no {DECLARED}: {FORMAT} is taken, as BehaviorTree.CPP does", cure, "ALU623", warning=True)
        return replace(document, slips=(*document.slips, slip)) if trees else document
    shown = _shown(mark)
    decisions = convert(document)
    left = f", but for what a person has to decide ({len(decisions)})" if decisions else ""
    message = f"is of BehaviorTree.CPP 3, as {shown} shows, and is read by its rules{left}"
    cure = f"convert it: `alula tree --to {FORMAT} FILE --out FILE`"
    return replace(document, slips=(*document.slips, Problem(mark.place, message, cure, "ALU623", warning=True)))


def convert(document: Document) -> list[Problem]:
    """Make a document of format 3 one of format 4, in place; return what could not be converted, or not for sure."""
    decisions: list[Problem] = []
    document.root.set(DECLARED, FORMAT)
    for top in document.root.children:
        for element in list(top.iterate()):
            was = element.tag
            _rename(element)
            if top.tag == "BehaviorTree":
                _convert(element, was, decisions.append)
    return decisions


def _kind(element: Element) -> str:
    return element.get("ID") if element.tag in CATEGORIES and element.tag != "SubTree" else element.tag


def _marks(trees: list[Element]) -> Iterator[Attribute | Element]:
    """Yield what only files of format 3 have, the sure marks first."""
    elements = [one for tree in trees for one in tree.iterate()]
    for element in elements:
        if _kind(element) in TAGS or _kind(element) in CHECKS:
            yield element
        yield from (one for name, one in element.attributes.items() if name in {SHARED, OLD_AUTOREMAP})
        if element.tag == "Parallel":
            yield from (one for name, one in element.attributes.items() if name in THRESHOLDS)
    if not any(_is_new(element) for element in elements):
        yield from (one for element in elements if element.tag == "SubTree" for one in _remappings(element) if _names_entry(one.value))


def _is_new(element: Element) -> bool:
    """Return whether only files of format 4 have such a node."""
    if element.tag in NEW_TAGS or any(name.startswith("_") and name[1:2].isalpha() and name != "_uid" for name in element.attributes):
        return True
    return element.tag == "SubTree" and any(BRACES.fullmatch(one.value) for one in _remappings(element))


def _remappings(element: Element) -> list[Attribute]:
    return [one for name, one in element.attributes.items() if name not in {"ID", "name"} and not name.startswith("_")]


def _names_entry(value: str) -> bool:
    return ENTRY.fullmatch(value) is not None and value not in WORDS


def _shown(mark: Attribute | Element) -> str:
    return f"<{mark.tag}>" if isinstance(mark, Element) else f'{mark.name}="{mark.value}"'


def _rename(element: Element) -> None:
    """Give a node the name of its type in format 4."""
    name = TAGS.get(element.tag)
    if name is not None:
        if name == "SubTree":
            _set_name(element, OLD_AUTOREMAP, AUTOREMAP)
        _retag(element, name)
    elif element.tag in CATEGORIES and element.get("ID") in TAGS:
        element.set("ID", TAGS[element.get("ID")])


def _retag(element: Element, name: str) -> None:
    element.closing = element.closing.replace(element.tag, name, 1)
    element.tag = name


def _set_name(element: Element, old: str, new: str) -> None:
    """Call an attribute otherwise, where it stands."""
    attributes = [replace(one, name=new) if one.name == old else one for one in element.attributes.values()]
    element.attributes = {one.name: one for one in attributes}


def _convert(element: Element, was: str, decide: Callable[[Problem], object]) -> None:
    """Convert what a node says; ``was``: the name of its type in format 3."""
    if element.tag == "SubTree":
        _convert_subtree(element, [] if was != "SubTree" else _remappings(element), decide)
    elif _kind(element) == "Parallel":
        for old, new in THRESHOLDS.items():
            _set_name(element, old, new)
    elif _kind(element) in CHECKS:
        _convert_check(element, decide)


def _convert_subtree(element: Element, remappings: list[Attribute], decide: Callable[[Problem], object]) -> None:
    """Convert a subtree; ``remappings``: its attributes that name entries without braces, as those of a SubTreePlus don't."""
    for remap in [child for child in element.children if child.tag == "remap"]:
        element.content.remove(remap)
        element.set(remap.get("internal"), f"{{{remap.get('external')}}}")
        if not "".join(str(part) for part in element.content).strip():
            element.content, element.empty = [], True
    shared = element.attributes.get(SHARED)
    if shared is not None and shared.value.strip().lower() in {"1", "true"}:
        message = "the subtree shared all entries; with _autoremap it shares all but those whose names begin with `_`"
        decide(Problem(shared.place, message, "see that no such name is used"))
        _set_name(element, SHARED, AUTOREMAP)
    elif shared is not None:
        del element.attributes[SHARED]
    for one in remappings:
        braces = BRACES.fullmatch(one.value)
        if _names_entry(one.value):
            element.set(one.name, f"{{{one.value}}}")
        elif braces is not None:
            message = f'{one.name}="{one.value}" was the entry of that name with its braces; now it is the entry `{braces[1]}`'
            decide(Problem(one.place, message, "see that this is meant"))
        else:
            message = f'{one.name}="{one.value}" was the entry of that name; now the text is what the subtree gets'
            decide(Problem(one.place, message, "see that this is meant"))


def _convert_check(element: Element, decide: Callable[[Problem], object]) -> None:
    """Replace a decorator that looks at two values in every tick by a reactive node with a condition, which does."""
    kind, mismatch = _kind(element), element.get("return_on_mismatch", "FAILURE")
    is_text = kind.endswith("String")
    values = [_operand(element.get(name), is_text=is_text) for name in ("value_A", "value_B")]
    tag = {"FAILURE": "ReactiveSequence", "SUCCESS": "ReactiveFallback"}.get(mismatch)
    if tag is None or None in values:
        message = f"{kind} has no counterpart in format 4 where it answers {mismatch or 'nothing'}"
        decide(Problem(element.place, message, "write a ScriptCondition before its child"))
        return
    code = f"{values[0]} == {values[1]}"
    decide(Problem(element.place, f"{kind} became the condition `{code}`, which fails in the tick where an entry is not written yet"))
    place, name = element.place, element.attributes.get("name")
    condition = Element("ScriptCondition", place, {"code": Attribute("code", code, place)}, empty=True)
    if tag == "ReactiveFallback":
        condition = Element("Inverter", place, content=[condition])
    _retag(element, tag)
    element.attributes = {"name": name} if name is not None else {}
    lead = element.content[:1] if element.content and isinstance(element.content[0], str) and not element.content[0].strip() else []
    element.content = [*lead, condition, *element.content]
    element.empty = False


def _operand(value: str, *, is_text: bool) -> str | None:
    """Return a value as scripts write it; None where they can't."""
    braces = BRACES.fullmatch(value)
    if braces is not None:
        return braces[1] if ENTRY.fullmatch(braces[1]) else None
    if is_text:
        return f"'{value}'" if "'" not in value else None
    return value.strip() if NUMBER.fullmatch(value) or value.strip() in WORDS else None
