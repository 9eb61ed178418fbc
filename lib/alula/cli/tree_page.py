"""The page of a tree that was ticked without a robot: that of runs, with a moment for each tick."""

from __future__ import annotations

from alula.common.record import BLACKBOARD, TREE, Entry
from alula.missions.treeview import TreeWatch
from alula.report.page.entries import RUN, TICKED, Converter, Wire
from alula.report.page.writing import make_page
from alula.trees.answers import Tick
from alula.trees.tree import Tree


class TreePage:
    """Collects the ticks of a tree, from before the first one on."""

    def __init__(self, tree: Tree) -> None:
        self._watch = TreeWatch(tree.root)
        self._converter = Converter()
        self._entries: list[Wire] = []

    def add(self, tick: Tick, now_ns: int) -> None:
        """Take note of a tick that has just been, ``now_ns`` mission clock."""
        view = Entry(TREE, now_ns, self._watch.look().as_dict())
        self._entries += self._converter.convert(view)
        t_s = now_ns / 1e9
        if tick.written:
            self._entries.append((BLACKBOARD, t_s, dict(tick.written)))
        written = [f"{name} := {value}" for name, value in tick.written.items()]
        self._entries.append((TICKED, t_s, {"number": tick.number, "root": tick.root, "text": "; ".join([tick.as_text(), *written])}))

    def text(self, title: str) -> str:
        """Return the page."""
        return make_page(title=title, entries=[(RUN, None, {"name": title}), *self._entries])
