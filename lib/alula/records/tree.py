"""Where in a mission's tree something happened: paths are the names of the nodes from the root down."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from alula.common.record import DECISIONS, TREE, Entry

Path = tuple[str, ...]
View = Mapping[str, Any]
"""A tree as ``NodeView.as_dict`` returns it."""


@dataclass(frozen=True)
class Places:
    """Where the executions of a mission were started, by their id, and where the tree was at its end; empty: not known."""

    started: Mapping[str, Path] = field(default_factory=dict)
    end: Path = ()

    def response(self, failed: str, started: str | None) -> str:
        """Name the branch that responded to the failure of an execution: the first node that leads elsewhere than to what failed.

        ``started`` is the execution that was started next, None where none was: then it is where the tree ended. Where the same leaf
        starts once more, it is the node above, which repeats it. Empty where the tree is not known, or stayed where it was.
        """
        here, there = self.started.get(failed, ()), self.end if started is None else self.started.get(started, ())
        if not here or not there:
            return ""
        common = next((at for at, (one, other) in enumerate(zip(here, there, strict=False)) if one != other), min(len(here), len(there)))
        if common < len(there):
            return there[common]
        return there[-2] if started is not None and here == there and len(there) > 1 else ""


def places_in(entries: Iterable[Entry]) -> Places:
    """Return the places of executions in the tree: the first view after a decision shows the leaf at work."""
    found: dict[str, Path] = {}
    waiting: dict[str, str] = {}
    tree: View = {}
    for entry in entries:
        if entry.topic == DECISIONS and entry.value["kind"] == "start":
            waiting[str(entry.value["id"])] = f"{entry.value['skillset']}.{entry.value['skill']}"
        elif entry.topic == TREE:
            tree = entry.value
            found |= {execution: path_to(tree, skill) for execution, skill in waiting.items()}
            waiting.clear()
    return Places(found, tip_of(tree))


def path_to(tree: View, skill: str) -> Path:
    """Return the path to the leaf of a skill that is at work or was last, empty where there is none."""
    found: dict[str, Path] = {}

    def walk(node: View, above: Path) -> None:
        path = (*above, str(node.get("name", "")))
        if node.get("skill") == skill and node.get("status") != "INVALID":
            found.setdefault(str(node.get("status")), path)
        for child in node.get("children", ()):
            walk(child, path)

    if tree:
        walk(tree, ())
    return found.get("RUNNING", next(iter(found.values()), ()))


def tip_of(tree: View) -> Path:
    """Return the path to where a tree has got: down along the last children that were ticked."""
    path: list[str] = []
    node: View | None = tree or None
    while node is not None:
        path.append(str(node.get("name", "")))
        node = next((child for child in reversed(node.get("children", ())) if child.get("status") != "INVALID"), None)
    return tuple(path)
