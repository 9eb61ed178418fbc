"""A tree on a clock that the test moves, with leaves whose answers are given."""

from __future__ import annotations

from oracle_leaves import Act, Ask, Story, tell

from alula.trees.factory import make_tree
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.status import NAMES


def registry():
    """Return the standard registry with leaves whose answers are given."""
    made = standard_registry()
    made.register(Act)
    made.register(Ask)
    return made


def frame(body: str, more: str = "") -> str:
    """Return a file whose main tree is this."""
    return f'<root BTCPP_format="4" main_tree_to_execute="main"><BehaviorTree ID="main">{body}</BehaviorTree>{more}</root>'


class Played:
    """One tree: ``tick(at_ms)`` gives the root's answer by name; ``calls`` of the leaves since the last tick."""

    def __init__(self, body: str, answers: dict[str, list[str]] | None = None, *, more: str = "", nodes=None, **kwargs) -> None:
        self.now_ns = 0
        self.story = Story(answers or {})
        self.tree = make_tree(read_text(frame(body, more)), nodes or registry(), lambda: self.now_ns, **kwargs)

    def tick(self, at_ms: int | None = None) -> str:
        if at_ms is not None:
            self.now_ns = at_ms * 1_000_000
        tell(self.story)
        self.story.calls.clear()
        return NAMES[self.tree.tick()]

    @property
    def calls(self) -> list[tuple[str, str]]:
        return list(self.story.calls)

    def halt(self) -> list[tuple[str, str]]:
        tell(self.story)
        self.story.calls.clear()
        self.tree.halt()
        return self.calls
