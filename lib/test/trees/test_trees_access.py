"""What a node reads and writes, as check and search read it."""

from __future__ import annotations

import pytest

from alula.trees.access import (
    Accesses,
    named_entries,
    scripts_after,
    scripts_before,
    scripts_of,
    scripts_within,
    takes_script_from_entry,
    written_entries,
)
from alula.trees.configuration import configure
from alula.trees.document import Element
from alula.trees.factory import build_tree
from alula.trees.node import Shared
from alula.trees.node_type import NodeType
from alula.trees.reading import read_text
from alula.trees.script import names_in, statements_of
from alula.trees.script.syntax import Name
from alula.trees.standard import standard_registry


def node(line: str) -> tuple[Element, NodeType]:
    element = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="a">{line}</BehaviorTree></root>').trees["a"].children[0]
    type_ = standard_registry().get(element.tag)
    assert type_ is not None
    return element, type_


def test_scripts_come_in_the_order_in_which_they_run() -> None:
    element, type_ = node('<Script _post="p" code="c" _onSuccess="s" _while="w" _skipIf="k"/>')
    assert [one.name for one in scripts_before(element)] == ["_skipIf", "_while"]
    assert [one.name for one in scripts_within(element, type_)] == ["code"]
    assert [one.name for one in scripts_after(element)] == ["_onSuccess", "_post"]
    assert [one.value for one in scripts_of(element, type_)] == ["k", "w", "c", "s", "p"]
    assert [one.name for one in scripts_of(element, None)] == ["_skipIf", "_while", "_onSuccess", "_post"]


@pytest.mark.parametrize(("code", "from_entry"), [("a := 1", False), ("{code}", True), (" {code}", True)])
def test_a_script_that_an_entry_holds_is_none_of_the_file(code: str, from_entry: bool) -> None:  # noqa: FBT001
    element, type_ = node(f'<Script code="{code}"/>')
    assert takes_script_from_entry(element, type_) is from_entry
    assert bool(list(scripts_within(element, type_))) is not from_entry


def test_what_ports_name_is_told_apart_by_whether_it_is_written() -> None:
    files = read_text(
        '<root BTCPP_format="4"><BehaviorTree ID="a"><Sequence><Script code="n := 1"/>'
        '<LoopDouble queue="{all}" value="{=}"><AlwaysSuccess/></LoopDouble></Sequence></BehaviorTree></root>'
    )
    loop = build_tree(files, standard_registry(), lambda: 0).root.children[1]
    assert named_entries(loop) == {"queue": "all", "value": "value"}
    assert written_entries(loop)["value"] == "value"


def test_a_script_that_can_not_be_read_has_no_statements() -> None:
    assert statements_of("a := ") == statements_of("") == ()
    assert names_in([*statements_of("a := b"), *statements_of("c += 1; running(x.y)")]).read == {"b", "c"}


def test_accesses_come_in_their_order_and_say_what_is_needed() -> None:
    files = read_text(
        '<root BTCPP_format="4" main_tree_to_execute="a"><BehaviorTree ID="a"><Sequence _onSuccess="n += RED">'
        '<SetBlackboard value="{n}" output_key="m"/><SubTree ID="b" k="3" l="{m}"/></Sequence></BehaviorTree>'
        '<BehaviorTree ID="b"><ScriptCondition code="k == l &amp;&amp; x.y == k &amp;&amp; f(k)"/></BehaviorTree></root>'
    )
    root = configure(files, standard_registry(), "a", Shared(int))
    inside = root.children[1].children[0].blackboard
    found = [(one.key, one.write, one.needed, one.in_passing) for one in Accesses(lambda one: statements_of(one.value), {"RED"}).of(root)]
    n, m, k = (root.blackboard, "n"), (root.blackboard, "m"), (inside, "k")
    read, written = (False, True, False), (True, True, False)
    assert found == [
        *((n, *read), (m, *written)),
        *((k, *written), (k, *read), (m, *read), (k, False, False, False)),
        *((n, False, True, True), (n, *written)),
    ]


def accesses(code: str) -> list[tuple[str, bool, bool, frozenset[str] | None]]:
    files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="a"><Script code="{code}"/></BehaviorTree></root>')
    root = configure(files, standard_registry(), "a", Shared(int))
    found = Accesses(lambda one: statements_of(one.value), None).in_script(root, "code")
    return [(one.name, one.write, one.sure, one.among) for one in found]


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("a := b", [("b", False, True, None), ("a", True, True, None)]),
        ("a += 1", [("a", False, True, None), ("a", True, True, None)]),
        ("a == 'x' ? b := 'x' : c", [("a", False, True, frozenset("x")), ("b", True, False, None), ("c", False, True, None)]),
        ("a == 'x' || a == 'y'", [("a", False, True, frozenset("xy"))] * 2),
        ("a == 'x' || b == 'y'", [("a", False, True, frozenset("x")), ("b", False, True, frozenset("y"))]),
        ("a == 'x' || a != 'y'", [("a", False, True, frozenset("x")), ("a", False, True, frozenset("y"))]),
        ("a == 1 || x.y == a", [("a", False, True, None), ("x.y", False, True, None), ("a", False, True, None)]),
        ("running(a)", []),
    ],
)
def test_a_script_says_which_writing_is_sure_and_which_texts_are_told_apart(
    code: str, expected: list[tuple[str, bool, bool, frozenset[str] | None]]
) -> None:
    assert accesses(code) == expected


def test_calls_name_what_they_ask_for() -> None:
    files = read_text('<root BTCPP_format="4"><BehaviorTree ID="a"><Script code="a := f(b.c) + g(\'d\', 1 + 2)"/></BehaviorTree></root>')
    root = configure(files, standard_registry(), "a", Shared(int))
    calls = Accesses(lambda one: statements_of(one.value)).calls(root, "code")
    assert [(one.function, one.named) for one in calls] == [("f", ("b.c",)), ("g", ("d", ""))]


def test_all_scripts_of_a_node_are_read_in_the_order_in_which_they_run() -> None:
    line = '<Script _post="d := 1" code="a := b == c" _skipIf="e"/>'
    root = configure(
        read_text(f'<root BTCPP_format="4"><BehaviorTree ID="a">{line}</BehaviorTree></root>'), standard_registry(), "a", Shared(int)
    )
    accesses = Accesses(lambda one: statements_of(one.value), None)
    assert [(one.name, one.write) for one in accesses.in_scripts(root)] == [(name, name in {"a", "d"}) for name in "ebcad"]
    assert [one.name for one in accesses.parts(root) if isinstance(one, Name)] == ["e", "b", "c", "a", "d"]
    assert [type(one).__name__ for one in accesses.parts(root) if not isinstance(one, Name)] == [
        *("Assignment", "Comparison", "Assignment", "Literal"),
    ]
