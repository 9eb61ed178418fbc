"""Nodes on a clock that the test moves; a robot's own nodes; and what differs from BehaviorTree.CPP on purpose (docs/concepts/trees.md)."""

from __future__ import annotations

import pytest
from trees_clock import Played, registry

from alula.trees.blackboard import Blackboard
from alula.trees.errors import FileError, TickError
from alula.trees.node import Decorator, SyncAction
from alula.trees.ports import input_port, output_port
from alula.trees.standard import standard_registry
from alula.trees.status import FAILURE, RUNNING, SUCCESS
from alula.trees.values import DOUBLE, INT, UINT

# --- time is the clock that is given ---------------------------------------------------------------------------------


def test_sleep_runs_for_its_time_and_anew_after_a_halt():
    tree = Played('<Sleep msec="100"/>')
    assert [tree.tick(at) for at in (0, 99, 100)] == ["RUNNING", "RUNNING", "SUCCESS"]
    assert [tree.tick(at) for at in (150, 200)] == ["RUNNING", "RUNNING"]
    tree.halt()
    assert [tree.tick(at) for at in (210, 260, 310)] == ["RUNNING", "RUNNING", "SUCCESS"]


@pytest.mark.parametrize(
    ("given", "condition"),
    [
        ("42", "x + 1 == 43"),
        ("-3", "x + 1 == -2"),
        ("3.14", "x &gt; 3.0 &amp;&amp; x * 2 == 6.28"),
        ("1e3", "x / 2 == 500"),
        (".5", "x == 0.5"),
        ("hello", "x == 'hello'"),
        ("1;2", "x == '1;2'"),
        (" 1", "x == ' 1'"),
        ("+1", "x == '+1'"),
        ("1 m", "x == '1 m'"),
        ("inf", "x == 'inf'"),
        ("1e999", "x == '1e999'"),
        ("", "x == ''"),
    ],
)
def test_a_number_given_to_a_subtree_is_one_to_its_scripts(given, condition):
    below = f'<BehaviorTree ID="below"><ScriptCondition code="{condition}"/></BehaviorTree>'
    assert Played(f'<SubTree ID="below" x="{given}"/>', more=below).tick() == "SUCCESS"


@pytest.mark.parametrize(("given", "port"), [("500", "msec"), ("0.5e3", "msec")])
def test_a_number_given_to_a_subtree_is_read_by_ports_of_any_number(given, port):
    below = f'<BehaviorTree ID="below"><Sleep {port}="{{x}}"/></BehaviorTree>'
    tree = Played(f'<SubTree ID="below" x="{given}"/>', more=below)
    assert [tree.tick(at) for at in (0, 499, 500)] == ["RUNNING", "RUNNING", "SUCCESS"]


def test_delay_ticks_its_child_after_its_time():
    tree = Played('<Delay delay_msec="100"><Act name="a"/></Delay>', {"a": ["RUNNING", "SUCCESS"]})
    assert [(tree.tick(at), tree.calls) for at in (0, 99, 100, 101)] == [
        ("RUNNING", []),
        ("RUNNING", []),
        ("RUNNING", [("start", "a")]),
        ("SUCCESS", [("tick", "a")]),
    ]


def test_timeout_halts_what_runs_for_too_long():
    tree = Played('<Timeout msec="100"><Act name="a"/></Timeout>', {"a": ["RUNNING"]})
    assert [(tree.tick(at), tree.calls) for at in (0, 99, 100, 150, 249)] == [
        ("RUNNING", [("start", "a")]),
        ("RUNNING", [("tick", "a")]),
        ("FAILURE", [("halt", "a")]),
        ("RUNNING", [("start", "a")]),
        ("RUNNING", [("tick", "a")]),
    ]


def test_what_was_written_has_the_time_of_the_clock():
    tree = Played('<Script code="x := 1"/>')
    tree.tick(7)
    entry = tree.tree.blackboard.entry("x")
    assert (entry.value, entry.sequence, entry.stamp_ns) == (1, 1, 7_000_000)


# --- TryCatch, which the version that the oracle has lacks -----------------------------------------------------------


def test_try_catch_cleans_up_and_fails():
    body = '<TryCatch><Act name="a"/><Act name="b"/><Act name="c"/></TryCatch>'
    tree = Played(body, {"a": ["SUCCESS"], "b": ["RUNNING", "FAILURE"], "c": ["RUNNING", "SUCCESS"]})
    assert [(tree.tick(), tree.calls) for _ in range(3)] == [
        ("RUNNING", [("start", "a"), ("start", "b")]),
        ("RUNNING", [("tick", "b"), ("start", "c")]),
        ("FAILURE", [("tick", "c")]),
    ]
    assert Played(body, {"a": ["SUCCESS"], "b": ["SUCCESS"], "c": ["SUCCESS"]}).tick() == "SUCCESS"
    assert Played(body, {"a": ["SKIPPED"], "b": ["SKIPPED"], "c": ["SUCCESS"]}).tick() == "SKIPPED"


@pytest.mark.parametrize(
    ("port", "calls"), [("", [("halt", "a")]), (' catch_on_halt="true"', [("halt", "a"), ("start", "c"), ("halt", "c")])]
)
def test_try_catch_cleans_up_for_a_tick_when_it_is_halted_and_asked_to(port, calls):
    tree = Played(f'<TryCatch{port}><Act name="a"/><Act name="c"/></TryCatch>', {"a": ["RUNNING"], "c": ["RUNNING"]})
    tree.tick()
    assert tree.halt() == calls


# --- lists -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("queue", [[1, 2], (1, 2), "1;2"])
def test_a_loop_takes_lists_of_the_blackboard(queue):
    board = Blackboard(lambda: 0)
    board.set("q", queue)
    body = '<LoopInt queue="{q}" value="{n}" if_empty="SUCCESS"><Script code="sum := n"/></LoopInt>'
    tree = Played(body, blackboard=board)
    assert [(tree.tick(), board.get("sum")) for _ in range(3)] == [("RUNNING", 1), ("RUNNING", 2), ("SUCCESS", 2)]


# --- a robot's own nodes ---------------------------------------------------------------------------------------------


class Double(SyncAction):
    """Writes twice what it reads."""

    ports = (input_port("of", DOUBLE, "1.5", "a number", unit="m"), output_port("to", DOUBLE))

    def update(self):
        self.put("to", 2 * self.get("of"))
        return SUCCESS


class Twice(Decorator):
    """Needs its child to succeed twice."""

    def __init__(self, config):
        super().__init__(config)
        self._left = 2

    def update(self):
        answer = self.child.execute()
        if answer is RUNNING:
            return RUNNING
        self._left -= 1
        self.reset_children()
        return FAILURE if answer is FAILURE else RUNNING if self._left else SUCCESS


def test_a_robot_registers_its_own_nodes_with_their_ports():
    nodes = standard_registry()
    nodes.register(Double, "uav.Double")
    nodes.register(Twice)
    known = nodes.get("uav.Double")
    assert (known.category.value, known.doc, known.ports["of"].unit) == ("Action", "Writes twice what it reads.", "m")
    tree = Played('<Twice><uav.Double to="{x}"/></Twice>', nodes=nodes)
    assert [tree.tick(), tree.tick(), tree.tree.blackboard.get("x")] == ["RUNNING", "SUCCESS", 3.0]
    with pytest.raises(ValueError, match="registered already"):
        nodes.register(Twice)


def test_a_port_without_a_value_says_so_when_it_is_read():
    nodes = standard_registry()
    nodes.register(Double)
    for attributes, message in {
        'of="{y}" to="{x}"': r"<text>:1:\d+ \(Double\): the port 'of' reads 'y', which nothing has written",
        'of="{=}" to="{x}"': "the port 'of' reads 'of'",
    }.items():
        with pytest.raises(TickError, match=message):
            Played(f"<Double {attributes}/>", nodes=nodes).tick()
    with pytest.raises(FileError, match="'fast' is no double"):
        Played('<Double of="fast"/>', nodes=nodes)


def test_scripts_see_what_surrounds_the_tree():
    class World:
        def value(self, name):
            return "IN_AIR" if name == "navigation.flight_status" else None

        def call(self, name, arguments):
            if name != "running":
                raise KeyError(name)
            return arguments == ["navigation.goto"]

    body = '<ScriptCondition code="navigation.flight_status == IN_AIR &amp;&amp; running(navigation.goto)"/>'
    assert Played(body, environment=World(), enums={"IN_AIR": 1, "ON_GROUND": 0}).tick() == "SUCCESS"
    assert Played(body.replace("IN_AIR", "ON_GROUND"), environment=World(), enums={"IN_AIR": 1, "ON_GROUND": 0}).tick() == "FAILURE"


# --- what differs on purpose -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("tag", ["SkipUnlessUpdated", "WaitValueUpdate"])
def test_what_waits_for_an_entry_halts_its_child(tag):
    """Version 4.8 leaves the child running, an orphan; 4.10 halts it, as here."""
    tree = Played(f'<Sequence><Script code="x := 1"/><{tag} entry="x"><Act name="a"/></{tag}></Sequence>', {"a": ["RUNNING"]})
    tree.tick()
    assert tree.halt() == [("halt", "a")]


def test_only_what_runs_is_halted_with_the_tree():
    """BehaviorTree.CPP runs `_onHalted` of every node of a tree that is halted, also of those that never ran."""
    tree = Played('<Fallback><Act name="a" _onHalted="x := 1"/><AlwaysSuccess _onHalted="y := 1"/></Fallback>', {"a": ["RUNNING"]})
    tree.tick()
    tree.halt()
    assert tree.tree.blackboard.keys() == ["x"]


@pytest.mark.parametrize(("type_", "text"), [(INT, "12abc"), (INT, "1.5"), (UINT, "-1"), (DOUBLE, "1.5m")])
def test_text_with_more_than_a_number_is_none(type_, text):
    with pytest.raises(ValueError, match="is no"):
        type_.parse(text)


def test_a_remapping_to_the_root_is_the_roots_entry():
    more = '<BehaviorTree ID="s"><SubTree ID="t" n="{@n}"/></BehaviorTree><BehaviorTree ID="t"><Script code="n := 3"/></BehaviorTree>'
    tree = Played('<SubTree ID="s"/>', more=more)
    tree.tick()
    assert [(one.path, dict(one.blackboard.values())) for one in tree.tree.subtrees] == [("", {"n": 3}), ("s::1", {}), ("s::1/t::2", {})]


def test_text_is_written_over_what_has_no_type():
    writes = "".join(f'<SetBlackboard value="{value}" output_key="y"/>' for value in ("{x}", "7"))
    tree = Played(f'<Sequence><Script code="x := 1; y := 2"/>{writes}</Sequence>')
    assert (tree.tick(), tree.tree.blackboard.get("y")) == ("SUCCESS", "7")


def test_the_registry_of_the_field_is_complete():
    names = set(registry().names())
    assert names >= {f"Switch{count}" for count in range(2, 7)} | {"LoopInt", "LoopBool", "LoopDouble", "LoopString", "Script", "TryCatch"}
