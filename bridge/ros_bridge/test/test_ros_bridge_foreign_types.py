"""What nodes and files of others say about their types: a name whose type can't be read is refused, and no other name with it."""

import sys
import types as modules

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ros_bridge_definitions import types_of, write_all

from ros_bridge.checked_types import CheckedTypes
from ros_bridge.config import TopicRoute
from ros_bridge.decisions import Refused, RouteDecision, decide
from ros_bridge.errors import TypeUnknownError
from ros_bridge.graph import Graphs, Ros1Graph, Ros2Endpoint, Ros2Graph
from ros_bridge.ros1_definition import md5
from ros_bridge.routes import Context, RouteTable
from ros_bridge.selection import Selection

AFTER = "/after"  # in the order of names it comes behind what can't be read
STRING = "std_msgs/String"


def install(monkeypatch, *names):
    """Have classes of types in ROS 2, as far as discovery looks at them: ``package/kind/Name``."""
    for name in names:
        package, kind, short = name.split("/")
        module = sys.modules.get(f"{package}.{kind}") or modules.ModuleType(f"{package}.{kind}")
        setattr(module, short, type(short, (), {}))
        monkeypatch.setitem(sys.modules, package, modules.ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.{kind}", module)


def decided(types, ros1, ros2=None, headers=(), sums=None):
    """Decide about everything of two graphs; all publishers of ROS 1 answer with the same headers."""
    checked = CheckedTypes(types, lambda _: headers, sums)
    checked.look_at(ros1)
    return decide(Graphs(ros1, ros2 or Ros2Graph()), Selection(("*",)), checked)


def graph(topics=None, services=None):
    """Return a graph of ROS 1 in which one node publishes and serves all."""
    topics, services = {**(topics or {}), AFTER: STRING}, services or {}
    return Ros1Graph(
        {topic: frozenset({"/node"}) for topic in topics}, {}, dict.fromkeys(services, "/node"), types=topics, service_types=services
    )


def reasons(decisions):
    return {one.ros1_name: one.reason for one in decisions if isinstance(one, Refused)}


def routed(decisions):
    return {one.spec.ros1_name for one in decisions if isinstance(one, RouteDecision)}


@pytest.mark.parametrize(
    ("texts", "kind", "words"),
    [
        ({"odd_msgs/Outer": "Inner inner\n"}, "odd_msgs/Outer", "odd_msgs/Inner: ROS 1's definition is neither in"),
        ({"odd_msgs/Outer": "Outer inner\n"}, "odd_msgs/Outer", "odd_msgs/Outer contains itself"),
        ({"odd_msgs/A": "B b\n", "odd_msgs/B": "A[] a\n"}, "odd_msgs/A", "odd_msgs/A contains itself"),
        ({"odd_msgs/Outer": "int32 a\nint32 a\n"}, "odd_msgs/Outer", "two fields are called 'a'"),
        ({"odd_msgs/Outer": "int32[99999999999999999] a\n"}, "odd_msgs/Outer", "can't be a ROS 1 field"),
        ({"odd_msgs/Outer": "int32[9999999999] a\n"}, "odd_msgs/Outer", "more than the bridge converts"),
        ({"odd_msgs/Outer": "wstring a\n"}, "odd_msgs/Outer", "field 'a' is a wstring, and ROS 1 has no such kind of field"),
        ({}, "Outer", "'Outer' is no name of a type"),
        ({}, "../../etc/passwd", "is no name of a type"),
        ({}, "", "'' is no name of a type"),
        ({f"odd_msgs/N{n}": f"N{n + 1}[2] a\n" for n in range(60)}, "odd_msgs/N0", "more than 50 messages within each other"),
        (
            {f"odd_msgs/N{n}": "".join(f"N{n + 1} a{i}\n" for i in range(10)) for n in range(9)} | {"odd_msgs/N9": ""},
            "odd_msgs/N0",
            "more than the bridge converts",
        ),
    ],
)
def test_a_type_that_can_not_be_read_is_refused_with_its_reason_and_no_other(tmp_path, texts, kind, words):
    types = types_of(tmp_path, texts, {"odd_msgs/Outer": "int32 a\n", "odd_msgs/A": "int32 a\n", "odd_msgs/N0": "int32 a\n"})
    found = decided(types, graph({"/a": kind, "/b": kind}))
    assert words in reasons(found)["/a"]
    assert reasons(found)["/a"] == reasons(found)["/b"]  # also when it is asked for again
    assert routed(found) == {AFTER}


def test_what_a_part_fails_with_is_not_kept_as_a_definition(tmp_path):
    types = types_of(
        tmp_path, {"odd_msgs/Outer": "Inner inner\n"}, {"odd_msgs/Outer": "Inner inner\n", "odd_msgs/Inner": "int64 a\nint8 b\n"}
    )
    write_all(tmp_path / "ros1", {"odd_msgs/Inner": "int32 = = 5\n"})
    for _ in range(2):
        with pytest.raises(TypeUnknownError, match="odd_msgs/Inner"):
            types.message("odd_msgs/Outer")
    write_all(tmp_path / "ros1", {"odd_msgs/Inner": "int8 b\nint64 a\n"})
    assert not types.message("odd_msgs/Outer").same_layout


@pytest.mark.parametrize(
    "text", ["int64 a\nint64 b\n", "int64 a\nint64 b\n----\n", "int64 a\nint64 b\n--- # nothing\n", "---\nint64 a\n---\nint8 b\n"]
)
def test_dividers_of_services_are_read_as_genmsg_reads_them(tmp_path, text, monkeypatch):
    install(monkeypatch, "odd_srvs/srv/Ask")
    request, response = ("int64 a\nint64 b", "") if not text.startswith("---") else ("", "int64 a\nint8 b")
    types = types_of(tmp_path, {"odd_srvs/srv/Ask": text}, {"odd_srvs/srv/Ask": f"{request}\n---\n{response}\n"})
    found = decided(types, graph(services={"/ask": "odd_srvs/Ask"}))
    assert routed(found) == {"/ask", AFTER}
    assert types.service("odd_srvs/Ask").md5sum == md5(request + response)


def test_a_service_of_ros2_without_a_divider_is_refused_alone(tmp_path):
    types = types_of(tmp_path, {}, {"odd_srvs/srv/Ask": "int64 a\n"})
    found = decided(types, graph(services={"/ask": "odd_srvs/Ask", "/bad": "AddTwoInts"}))
    assert "'AddTwoInts' is no name of a type" in reasons(found)["/bad"]
    assert routed(found) == {AFTER}
    assert reasons(found).keys() == {"/ask", "/bad"}


class BrokenTypes:
    """Raises what nobody expects, about one name."""

    def __init__(self, types):
        self._types = types

    def pair(self, ros1_type, ros2_type, topic):
        if topic == "/a":
            raise RecursionError("too deep\n" * 400)
        return self._types.pair(ros1_type, ros2_type, topic)


def test_whatever_is_raised_about_a_name_refuses_it_in_one_line(tmp_path):
    types = BrokenTypes(CheckedTypes(types_of(tmp_path, {}, {}), lambda _: ()))
    found = decide(Graphs(graph({"/a": STRING}), Ros2Graph()), Selection(("*",)), types)
    assert routed(found) == {AFTER}
    assert reasons(found)["/a"].startswith("RecursionError: too deep too deep")
    assert len(reasons(found)["/a"]) < 600


class OneRoute:
    """A route that does not start or not close."""

    def __init__(self, name):
        self._name = name

    def start(self):
        if self._name == "/start":
            raise KeyError(self._name)

    def figures(self):
        from ros_bridge.stats import Figures

        return Figures()

    def close(self):
        if self._name == "/close":
            raise OSError(self._name)


def test_a_route_that_can_not_be_made_started_or_closed_leaves_the_others_alone():
    def make(spec, _context):
        if spec.ros1_name == "/make":
            raise ValueError("no such part")
        return OneRoute(spec.ros1_name)

    def route(name):
        from ros_bridge.config import Direction

        return TopicRoute(name, name, Direction.ROS1_TO_ROS2, STRING)

    table = RouteTable({TopicRoute: make}, Context(None, None, None))
    specs = [route(name) for name in ("/close", "/make", "/start", AFTER)]
    table.reconcile(specs)
    for spec in specs:
        table.start(spec)
    assert {spec.ros1_name: reason for spec, reason in table.failed.items()} == {
        "/make": "ValueError: no such part",
        "/start": "KeyError: '/start'",
    }
    assert table.started(route(AFTER))
    table.reconcile([route(AFTER)])
    assert list(table.running()) == [route(AFTER)]


LINES = st.sampled_from(
    [
        "int32 a",
        "int32 a=1",
        "string S=x # y",
        "Header h",
        "time t",
        "uint8[] d",
        "B[3] b",
        "other_msgs/C c",
        "---",
        "----",
        "--- x",
        "=" * 80,
        "MSG: fuzz_msgs/B",
        "MSG: ",
        "int32[<=3] a",
        "string<=4 a",
        "wstring w",
        "a/b/c d",
        "int32 class",
        "int32",
        "= = =",
        "# ",
        "A a",
        "\t",
        "x y z",
        "float64[36] c",
        "int32 a 5",
        "bool[",
        "int32[-1] n",
        "builtin_interfaces/Time t",
        "int32 a\r",
        "\ufeffint32 a",
        "int32 \u00e9",
        "\x00",
    ],
)
TEXTS = st.lists(LINES | st.text(max_size=12), max_size=6).map("\n".join)
NAMES = st.sampled_from(
    ["fuzz_msgs/A", "fuzz_msgs/B", "fuzz_msgs/Ask", "std_msgs/Header", "A", "", "a/b/c", "/", "fuzz_msgs/", "*", "x y/z"]
) | st.text(
    max_size=12,
)
SUMS = st.sampled_from(["", "*", "0" * 32, "x"])
HEADERS = st.lists(
    st.dictionaries(st.sampled_from(["type", "md5sum", "message_definition", "callerid"]), TEXTS | NAMES | SUMS, max_size=4), max_size=2
)


@settings(max_examples=150, suppress_health_check=list(HealthCheck), database=None, deadline=None)
@given(st.data())
def test_no_definition_probe_or_header_keeps_another_topic_from_crossing(tmp_path_factory, data):
    """``/after`` is decided on in the same pass: what is said of the other names can't put it off to a later one."""
    folder = tmp_path_factory.mktemp("fuzz")
    names = ["fuzz_msgs/A", "fuzz_msgs/B", "fuzz_msgs/srv/Ask", "fuzz_msgs/action/Go", "std_msgs/String2"]
    worlds = [{name: data.draw(TEXTS) for name in names if data.draw(st.booleans())} for _ in range(2)]
    types = types_of(folder, *worlds)
    topics = {"/a": data.draw(NAMES), "/b": "fuzz_msgs/A", "/go/goal": "fuzz_msgs/GoActionGoal", "/go/status": data.draw(NAMES)}
    one = graph(topics, {"/ask": data.draw(NAMES), "/ask2": "fuzz_msgs/Ask"})
    one.subscribers["/go/goal"] = frozenset({"/node"})
    two = Ros2Graph(
        {"/c": (Ros2Endpoint("/n", data.draw(NAMES)),)}, {"/b": (Ros2Endpoint("/n", data.draw(NAMES)),)}, {"/d": data.draw(NAMES)}
    )
    headers, sums = data.draw(HEADERS), {"/ask2": data.draw(SUMS)}
    found = decided(types, one, two, headers, sums)
    assert AFTER in routed(found)
    for decision in found:
        if isinstance(decision, RouteDecision) and isinstance(decision.spec, TopicRoute):
            types.message(decision.spec.type_name, decision.spec.ros2_type, decision.spec.md5sum)  # then the route can be made
    assert all(one.reason and "\n" not in one.reason for one in found if isinstance(one, Refused))
