"""The decision what to bridge: pure, so every case is a table of publishers and subscribers in each world."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_bridge.checked_types import CheckedPair
from ros_bridge.config import ActionRoute, Direction, Reliability, RosVersion, ServiceRoute, TopicRoute
from ros_bridge.decisions import BULKY_DEPTH, DEPTH, Refused, RouteDecision, decide
from ros_bridge.errors import BridgeError, TypeUnknownError
from ros_bridge.graph import Graphs, Ros1Graph, Ros2Endpoint, Ros2Graph, is_bridge
from ros_bridge.keep_alive import KEEP_ALIVE_S, KeepAlive
from ros_bridge.parameters import flatten
from ros_bridge.selection import Selection
from ros_bridge.stats import Figures
from ros_bridge.tables import Rates, list_table, live_table, render, summary

STRING = "std_msgs/String"
UP, DOWN = Direction.ROS1_TO_ROS2, Direction.ROS2_TO_ROS1
ALL = Selection(("*",))


class Types:
    """Every type is itself in the other world, but for one that the other world does not have."""

    def pair(self, ros1_type, ros2_type, name):
        kind = ros1_type or ros2_type
        if "no_msgs/No" in {ros1_type, ros2_type}:
            raise TypeUnknownError(f"{kind} is not in ROS 2")
        if kind == "no_msgs/Odd":
            raise KeyError(kind)
        return CheckedPair(kind, ros2_type or kind, bulky=kind == "sensor_msgs/Image")

    def service(self, ros1_type, ros2_type, name):
        if ros1_type is None and ros2_type is None:
            raise BridgeError("its node does not say its type")
        return self.pair(ros1_type, ros2_type, name)

    action = service


def ros1(publishers=(), subscribers=(), types=None, **more):
    topics = {*publishers, *subscribers}
    return Ros1Graph(
        {name: frozenset({"/node1"}) for name in publishers},
        {name: frozenset({"/node2"}) for name in subscribers},
        types=types or dict.fromkeys(topics, STRING),
        **more,
    )


def end(kind=STRING, *, reliable=True, transient_local=False):
    return Ros2Endpoint("/node", kind, reliable, transient_local)


def ros2(publishers=None, subscribers=None, **more):
    return Ros2Graph(publishers or {}, subscribers or {}, **more)


def decided(one, two, selection=ALL, configured=()):
    return decide(Graphs(one, two), selection, Types(), configured)


def test_a_ros1_publisher_is_offered_and_flows_when_it_has_a_subscriber():
    (alone,) = decided(ros1(["/a"]), ros2())
    assert alone == RouteDecision(TopicRoute("/a", "/a", UP, STRING, latched=True, depth=DEPTH, ros2_type=STRING))
    assert not alone.flows
    (heard,) = decided(ros1(["/a"]), ros2(subscribers={"/a": (end(), end())}))
    assert (heard.spec, heard.receivers, heard.flows) == (alone.spec, 2, True)


def test_subscribers_alone_are_nothing_to_bridge():
    assert decided(ros1(subscribers=["/a"]), ros2(subscribers={"/a": (end(),)})) == []


def test_both_ways_only_when_both_worlds_publish():
    ways = [one.spec.direction for one in decided(ros1(["/tf"], ["/tf"]), ros2({"/tf": (end(),)}, {"/tf": (end(),)}))]
    assert ways == [UP, DOWN]


@pytest.mark.parametrize(
    ("publishers", "reliability", "latched"),
    [
        ([end()], Reliability.RELIABLE, False),
        ([end(transient_local=True)], Reliability.RELIABLE, True),
        ([end(transient_local=True), end()], Reliability.RELIABLE, False),
        ([end(reliable=False)], Reliability.BEST_EFFORT, False),
        ([end(), end(reliable=False)], Reliability.BEST_EFFORT, False),
    ],
)
def test_from_ros2_the_bridge_asks_for_what_all_publishers_offer(publishers, reliability, latched):
    (one,) = decided(ros1(subscribers=["/a"]), ros2({"/a": tuple(publishers)}))
    assert (one.spec.reliability, one.spec.latched, one.receivers) == (reliability, latched, 1)


def test_depth_has_room_for_every_publisher_and_is_short_for_bulky_types():
    many = Ros1Graph({"/a": frozenset(f"/n{number}" for number in range(150))}, {}, types={"/a": STRING})
    assert decided(many, ros2())[0].spec.depth == 150
    assert decided(ros1(["/i"], types={"/i": "sensor_msgs/Image"}), ros2())[0].spec.depth == BULKY_DEPTH


def test_a_topic_of_any_type_waits_until_the_other_world_tells_it():
    listener = ros1(subscribers=["/a"], types={"/a": "*"})
    assert decided(listener, ros2()) == []
    (one,) = decided(listener, ros2({"/a": (end(),)}))
    assert (one.spec.type_name, one.spec.direction, one.receivers) == (STRING, DOWN, 1)
    silent = Ros1Graph({"/a": frozenset({"/n"})}, {}, types={"/a": "*"})
    assert decided(silent, ros2()) == []


def test_what_can_not_be_is_refused_with_the_reason():
    assert decided(ros1(["/a"], types={"/a": "no_msgs/No"}), ros2()) == [Refused("topic", "/a", "/a", "no_msgs/No is not in ROS 2")]
    (mixed,) = decided(ros1(subscribers=["/a"]), ros2({"/a": (end("a/B"), end("a/C"))}))
    assert mixed.reason == "ROS 2 has it with different types: a/B, a/C"


def test_services_and_actions_go_from_the_world_that_has_the_server():
    one = ros1(services={"/one": "/n", "/both": "/n", "/mute": "/n"}, service_types={"/one": "a/B", "/both": "a/B"})
    two = ros2(services={"/two": "c/D", "/both": "a/B"}, actions={"/go": "e/Go"})
    assert decided(one, two) == [
        Refused("service", "/both", "/both", "both worlds have a server"),
        Refused("service", "/mute", "/mute", "its node does not say its type"),
        RouteDecision(ServiceRoute("/one", "/one", RosVersion.ROS1, "a/B", ros2_type="a/B")),
        RouteDecision(ServiceRoute("/two", "/two", RosVersion.ROS2, "c/D", ros2_type="c/D")),
        RouteDecision(ActionRoute("/go", "/go", RosVersion.ROS2, "e/Go", ros2_type="e/Go")),
    ]


def test_an_action_of_ros1_is_known_by_its_topics_which_are_no_topics_then():
    server, client = frozenset({"/server"}), frozenset({"/client"})
    from_server = {"/go/status": server, "/go/feedback": server, "/go/result": server}
    to_server = {"/go/goal": server, "/go/cancel": server}
    types = {"/go/goal": "e/GoActionGoal", "/go/status": "actionlib_msgs/GoalStatusArray"}
    graph = Ros1Graph({**from_server, "/go/goal": client}, {**to_server, "/go/status": client}, types=types)
    assert decided(graph, ros2()) == [RouteDecision(ActionRoute("/go", "/go", RosVersion.ROS1, "e/Go", ros2_type="e/Go"))]
    assert Ros1Graph({"/go/goal": client}, {"/go/status": client}, types=types).action_servers() == {}


def test_own_ends_and_other_bridges_are_no_foreign_ones():
    assert is_bridge("/ros_bridge")
    assert is_bridge("/robot/ros_bridge")
    assert not is_bridge("/ros_bridge_user")


def test_patterns_and_what_is_never_bridged():
    names = ["/camera/left/image", "/camera/raw", "/rosout", "/odom"]
    chosen = Selection(("/camera/*", "/rosout"), ("*/raw",))
    assert [one.spec.ros1_name for one in decided(ros1(names), ros2(), chosen)] == ["/camera/left/image", "/rosout"]
    assert [one.spec.ros1_name for one in decided(ros1(names), ros2())] == ["/camera/left/image", "/camera/raw", "/odom"]


def test_configured_names_are_left_alone():
    configured = (TopicRoute("/a", "/b", UP, STRING),)
    assert decided(ros1(["/a", "/b"]), ros2({"/b": (end(),)}), configured=configured) == []


def test_namespaces_hold_the_other_worlds_names():
    selection = Selection(("*",), namespace1="/two", namespace2="/one", renames=(("/clock", "/clock"),))
    found = decided(ros1(["/a", "/two/b", "/clock"]), ros2({"/one/c": (end(),), "/d": (end(),)}), selection)
    pairs = {(one.spec.direction, one.spec.ros1_name, one.spec.ros2_name) for one in found}
    assert pairs == {
        (UP, "/a", "/one/a"),
        (UP, "/two/b", "/b"),
        (UP, "/clock", "/clock"),
        (DOWN, "/c", "/one/c"),
        (DOWN, "/two/d", "/d"),
    }


def test_a_name_whose_way_back_leads_elsewhere_is_not_bridged():
    selection = Selection(("*",), namespace2="/ros1")
    assert selection.to_ros1("/own") is None
    assert selection.to_ros1("/ros1/own") == "/own"


NAMES = st.lists(st.sampled_from(["a", "b", "one", "two"]), min_size=1, max_size=3).map(lambda parts: "/" + "/".join(parts))
SELECTIONS = st.builds(
    Selection,
    include=st.just(("*",)),
    namespace1=st.just("") | NAMES,
    namespace2=st.just("") | NAMES,
    renames=st.lists(st.tuples(NAMES, NAMES), max_size=2).map(tuple),
)


@settings(max_examples=300, database=None)
@given(SELECTIONS, st.sets(NAMES, max_size=4), st.sets(NAMES, max_size=4))
def test_no_renaming_makes_two_routes_meet_or_a_message_go_round(selection, names1, names2):
    found = [one.spec for one in decided(ros1(names1), ros2({name: (end(),) for name in names2}), selection)]
    for way in Direction:
        targets = [spec.target_name for spec in found if spec.direction is way]
        assert len(targets) == len(set(targets))
    partners = {(spec.ros1_name, spec.ros2_name) for spec in found}
    assert len({one for one, _ in partners}) == len({two for _, two in partners}) == len(partners)


def wanted(receivers=0, **changes):
    return RouteDecision(TopicRoute("/a", "/a", UP, STRING, **changes), receivers)


def test_a_route_lingers_after_its_publisher_and_flows_on_after_its_last_subscriber():
    keep_alive = KeepAlive()
    assert keep_alive.update([wanted(2)], 0.0) == [wanted(2)]
    assert keep_alive.update([wanted(0)], 1.0) == [wanted(2)]
    assert keep_alive.update([wanted(0)], KEEP_ALIVE_S - 0.1) == [wanted(2)]
    assert keep_alive.update([wanted(0)], KEEP_ALIVE_S + 0.1) == [wanted(0)]
    assert keep_alive.update([], KEEP_ALIVE_S + 1.0) == [wanted(0)]
    assert keep_alive.update([], 2 * KEEP_ALIVE_S + 0.2) == []


def test_another_quality_of_service_replaces_the_route_at_once():
    keep_alive = KeepAlive()
    keep_alive.update([wanted(1)], 0.0)
    assert keep_alive.update([wanted(1, latched=True)], 1.0) == [wanted(1, latched=True)]


def test_rates_are_those_since_the_last_look():
    rates = Rates()
    spec = wanted().spec
    assert rates.update({spec: Figures(count=10)}, 5.0) == {spec: 0.0}
    assert rates.update({spec: Figures(count=40)}, 7.0) == {spec: 15.0}


def test_figures_of_a_route_made_anew_go_on_counting():
    whole = Figures(5, 50, None, None, {"slow": 1}, 1).after(Figures(10, 100, 1.0, 2.0, {"slow": 2, "late": 1}))
    assert whole == Figures(15, 150, 1.0, 2.0, {"late": 1, "slow": 3}, 1)


def test_rows_tell_both_ways_of_a_topic_and_what_can_not_be():
    up, down = TopicRoute("/tf", "/tf", UP, STRING), TopicRoute("/tf", "/tf", DOWN, STRING, reliability=Reliability.BEST_EFFORT)
    figures = {down: Figures(count=2), up: Figures(count=7, p50_ms=0.5, dropped={"slow": 3})}
    topics = summary(figures, {up: 1.26})["topics"]
    assert {name: row["count"] for name, row in topics.items()} == {"/tf": 7, "/tf ros2_to_ros1": 2}
    assert (topics["/tf"]["rate_hz"], topics["/tf"]["dropped"], topics["/tf"]["dropped_why"]) == (1.26, 3, {"slow": 3})
    assert [row[0:3] for row in live_table(figures, {up: 1.0})[1:]] == [("/tf", "->", "/tf"), ("/tf", "<-", "/tf")]
    table = list_table([RouteDecision(down, 1), Refused("topic", "/x", "/y", "no such type")], {up: "configured"})
    assert [(row[0], row[2], row[5], row[6]) for row in table[1:]] == [
        ("topic", "->", "reliable, volatile, 10", "configured"),
        ("topic", "<-", "best effort, volatile, 10", "1 receive"),
        ("topic", "x", "", "can't be: no such type"),
    ]
    starts = [[line.index(cell) for cell in row[:2] if cell] for line, row in zip(render(table).splitlines(), table, strict=True)]
    assert all(before == after for before, after in pairwise(starts))


def test_parameters_get_ros2s_names_and_kinds():
    tree = {"a": {"b": 1, "c": {"d": [1, 2.5]}}, "e": [], "f": [True], "g": [1, "x"], "h": None, "i": [[1], [2]]}
    assert dict(flatten(tree)) == {
        "a.b": 1, "a.c.d": [1.0, 2.5], "e": [], "f": [True], "g": '[1, "x"]', "h": "null", "i": "[[1], [2]]",
    }  # fmt: skip
