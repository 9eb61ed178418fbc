"""A look at a tree costs what has changed: it is the last view, itself, where nothing has, and parts that have not stay."""

from __future__ import annotations

from py_trees.behaviours import Running, StatusQueue
from py_trees.common import Status
from py_trees.composites import Sequence

from alula.missions.treeview import TreeWatch


def test_views_share_what_has_not_changed_and_show_what_has() -> None:
    first, second = Sequence("first", memory=True), StatusQueue("second", [Status.SUCCESS, Status.RUNNING], None)
    first.add_child(StatusQueue("inner", [Status.SUCCESS], None))
    root = Sequence("root", memory=True)
    root.add_children([first, StatusQueue("between", [Status.RUNNING, Status.SUCCESS], None), second, Running("last")])
    watch = TreeWatch(root)
    idle = watch.look()
    assert watch.look() is idle
    root.tick_once()
    begun = watch.look()
    assert [child.status for child in begun.children] == ["SUCCESS", "RUNNING", "INVALID", "INVALID"]
    root.tick_once()
    later = watch.look()
    assert [child.status for child in later.children] == ["SUCCESS", "SUCCESS", "SUCCESS", "RUNNING"]
    assert later.children[0] is begun.children[0]
    root.children[3].feedback_message = "what a node says is seen, too"
    assert watch.look().children[3].message == "what a node says is seen, too"
    assert watch.look() is watch.look()
