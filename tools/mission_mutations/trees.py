"""Ways to alter a mission's file, each at each place where it can be done: a file with one alteration in it."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Iterator

FALLBACK_REMOVED = "a fallback removed"
CHILDREN_SWAPPED = "children swapped"
POLICY_CHANGED = "a policy changed"
RETRY_DROPPED = "a retry dropped"
RESULT_UNHANDLED = "a result unhandled"
CONDITION_NEGATED = "a condition negated"
OWN_DROPPED = "a node of the robot's own dropped"

CONTROLS = frozenset({"Sequence", "Fallback", "Parallel", "ParallelAll", "ReactiveSequence", "ReactiveFallback", "SequenceWithMemory"})
OTHER_POLICY = {
    "Sequence": ("Fallback", "ReactiveSequence"),
    "Fallback": ("Sequence", "ReactiveFallback"),
    "ReactiveSequence": ("Sequence",),
    "ReactiveFallback": ("Fallback",),
    "ForceSuccess": ("ForceFailure",),
    "ForceFailure": ("ForceSuccess",),
}
COUNTS = ("success_count", "failure_count")
AGAIN = frozenset({"RetryAfter", "RetryUntilSuccessful", "Repeat", "Until", "KeepRunningUntilFailure"})
FORCED = frozenset({"ForceSuccess", "ForceFailure"})
AFTER = ("_onSuccess", "_onFailure")
CONDITIONS = ("if", "code")
NO_CONDITION = frozenset({"Script"})
"""Nodes whose ``code`` is no condition."""
_FAILED = re.compile(r"failed(_first)?\([^)]*\)")

Change = Callable[[ET.Element, ET.Element], None]
"""Changes a node, the second, that stands in the first."""
Place = tuple[str, str, Change]
"""The kind of an alteration, what it does, and the change."""


def altered(text: str, own: Collection[str] = ()) -> Iterator[tuple[str, str, str]]:
    """Yield each altered file: kind, what was done to which node, and the file's text. ``own``: the robot's types with children."""
    root = ET.fromstring(text)  # noqa: S314 - the robot's own files
    numbers = {id(node): number for number, node in enumerate(root.iter())}
    for tree in root.iter("BehaviorTree"):
        for node in (inside for inside in tree.iter() if inside is not tree):
            for kind, what, change in _places(node, own):
                copied = copy.deepcopy(root)
                mine = list(copied.iter())[numbers[id(node)]]
                parent = next(one for one in copied.iter() if any(child is mine for child in one))
                change(parent, mine)
                yield kind, f"{tree.get('ID')}: '{node.get('name', node.tag)}': {what}", ET.tostring(copied, encoding="unicode")


def _places(node: ET.Element, own: Collection[str]) -> Iterator[Place]:
    yield from _fallbacks(node)
    yield from _policies(node)
    yield from _results(node)
    for at in range(len(node) if node.tag in own else 0):
        yield OWN_DROPPED, f"its child {at + 1} stands in its place", _by_child(at)
    if node.tag in CONTROLS or node.tag in own:
        for at in range(len(node) - 1):
            yield CHILDREN_SWAPPED, f"children {at + 1} and {at + 2} are swapped", _swap(at)
    if node.tag in AGAIN and len(node) == 1:
        yield RETRY_DROPPED, f"the {node.tag} around its child is gone", _by_child(0)
    for name in CONDITIONS if node.tag not in NO_CONDITION else ():
        if name in node.attrib:
            yield CONDITION_NEGATED, f"`{name}` is negated", _set(name, f"!({node.attrib[name]})")


def _fallbacks(node: ET.Element) -> Iterator[Place]:
    if not node.tag.endswith("Fallback") or len(node) < 2:
        return
    yield FALLBACK_REMOVED, "its first child stands in its place", _by_child(0)
    for at in range(1, len(node) if len(node) > 2 else 1):
        yield FALLBACK_REMOVED, f"without child {at + 1}", _without(at)


def _policies(node: ET.Element) -> Iterator[Place]:
    for tag in OTHER_POLICY.get(node.tag, ()):
        yield POLICY_CHANGED, f"{node.tag} is {tag}", _become(tag)
    for name in COUNTS if node.tag == "Parallel" else ():
        if node.get(name) == "1":
            yield POLICY_CHANGED, f"{name} is that of all children", _set(name, "-1")


def _results(node: ET.Element) -> Iterator[Place]:
    if node.tag in FORCED:
        yield RESULT_UNHANDLED, f"the {node.tag} around its child is gone", _by_child(0)
    for name in AFTER:
        if name in node.attrib:
            yield RESULT_UNHANDLED, f"without `{name}`", _drop(name)
    if node.tag == "RetryAfter" and "if" in node.attrib:
        yield RESULT_UNHANDLED, "nothing makes it try again", _set("if", "false")
    for name in CONDITIONS:
        for found in _FAILED.finditer(node.get(name, "")):
            text = node.attrib[name]
            yield RESULT_UNHANDLED, f"`{found[0]}` is not asked", _set(name, f"{text[: found.start()]}false{text[found.end() :]}")


def _by_child(at: int) -> Change:
    def change(parent: ET.Element, node: ET.Element) -> None:
        parent[list(parent).index(node)] = node[at]

    return change


def _without(at: int) -> Change:
    return lambda _, node: node.remove(node[at])


def _swap(at: int) -> Change:
    def change(_: ET.Element, node: ET.Element) -> None:
        node[at], node[at + 1] = node[at + 1], node[at]

    return change


def _become(tag: str) -> Change:
    return lambda _, node: setattr(node, "tag", tag)


def _set(name: str, value: str) -> Change:
    return lambda _, node: node.set(name, value)


def _drop(name: str) -> Change:
    def change(_: ET.Element, node: ET.Element) -> None:
        del node.attrib[name]

    return change
