"""Which definition of ROS 1 counts: what a peer has said, then the files in their order; and what happens where versions differ."""

import os
import struct
import subprocess
from pathlib import Path

import pytest
from ros_bridge_definitions import SEPARATOR, types_of, write, write_all

from ros_bridge.action_types import action_type
from ros_bridge.checked_types import ASK_AGAIN_S, CheckedTypes
from ros_bridge.conversion import Types
from ros_bridge.definitions import SHARES_VARIABLE, WORKSPACES_VARIABLE, DefinitionFiles, ros1_shares
from ros_bridge.errors import TypeDiffersError, TypeUnknownError
from ros_bridge.graph import Ros1Graph
from ros_bridge.mapping import TypeRule, TypeRules
from ros_bridge.ros1_definition import md5

OLD, NEW = "int32 a\nint32 b", "int32 b\nint32 a\nint8 c"
NODE = frozenset({"/driver"})


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Have each type installed in ROS 2: this is about definitions."""
    monkeypatch.setattr("ros_bridge.checked_types.interface_class", lambda *_: None)


def said(text, name="own_msgs/M", md5sum=""):
    return {"type": name, "md5sum": md5sum or md5(text.split(SEPARATOR)[0].strip()), "message_definition": text}


def test_places_come_in_their_order(tmp_path, monkeypatch):
    places = [tmp_path / name for name in ("workspace", "folder", "packages")]
    for number, place in enumerate(places):
        write(place, "own_msgs/M", f"int32 from_{number}\n")
    for variable, place in zip((WORKSPACES_VARIABLE, SHARES_VARIABLE, "ROS_PACKAGE_PATH"), places, strict=True):
        monkeypatch.setenv(variable, str(place))
    assert ros1_shares()[:3] == places
    for number, place in enumerate(places):
        assert DefinitionFiles(ros1_shares()).message("own_msgs/M") == f"int32 from_{number}\n"
        (place / "own_msgs/msg/M.msg").unlink()
    assert DefinitionFiles(ros1_shares()).message("own_msgs/M") is None


def test_packages_lie_anywhere_below_a_workspace(tmp_path):
    deep = tmp_path / "src/drivers/vendor"
    write_all(
        deep, {"folder/M": "int32 a\n", "folder/srv/S": "int32 q\n---\nint32 r\n", "folder/action/Go": "int32 g\n---\n---\nint32 f\n"}
    )
    (deep / "folder/package.xml").write_text("<package><name> own_msgs </name></package>")
    (tmp_path / "src/elsewhere").symlink_to(deep.parent)
    ignored = tmp_path / "src/old"
    write(ignored, "own_msgs/M", "int64 old\n")
    (ignored / "own_msgs/package.xml").write_text("<package><name>own_msgs</name></package>")
    (ignored / "CATKIN_IGNORE").touch()
    files = DefinitionFiles([tmp_path / "src"])
    found = [files.message(f"own_msgs/{name}") for name in ("M", "S_Request", "S_Response", "GoGoal", "GoResult", "GoFeedback", "No")]
    assert found == ["int32 a\n", "int32 q", "int32 r", "int32 g", "", "int32 f", None]


def test_the_robots_workspace_is_found_in_the_ros2_world():
    root = Path(os.environ["ALULA_ROOT"])
    ask = f"import os; print(os.environ['{WORKSPACES_VARIABLE}']); print(os.environ['ROS_PACKAGE_PATH'])"
    environment = {**os.environ, "ROS_PACKAGE_PATH": "/my/packages"}
    command = [str(root / "setup/in_ros2"), "python", "-c", ask]
    workspaces, packages = subprocess.run(command, env=environment, capture_output=True, check=True, text=True).stdout.splitlines()
    assert packages == "/my/packages"
    assert DefinitionFiles(map(Path, workspaces.split(":"))).message("skillset_interfaces/Unmet") is not None


def test_the_place_that_has_the_sum_of_the_node_counts(tmp_path):
    for place, text in (("one", OLD), ("two", NEW)):
        write(tmp_path / place, "own_msgs/M", text)
        write(tmp_path / place, "own_msgs/S", f"{text}\n---\nint8 ok\n", "srv")
    write_all(tmp_path / "ros2/share", {"own_msgs/M": OLD, "own_msgs/srv/S": f"{OLD}\n---\nint8 ok\n"})
    types = Types([tmp_path / "ros2"], None, DefinitionFiles([tmp_path / "one", tmp_path / "two"]))
    assert types.message("own_msgs/M").same_layout
    assert types.message("own_msgs/M", md5sum=md5(OLD)).same_layout
    newer = types.message("own_msgs/M", md5sum=md5(NEW))
    assert (newer.same_layout, newer.notes) == (False, ("only ROS 1 has field 'c'",))
    assert newer.to_ros2(struct.pack("<iib", 2, 1, 3))[4:] == struct.pack("<ii", 1, 2)
    assert types.service("own_msgs/S", md5sum=md5(NEW + "int8 ok")).md5sum == md5(NEW + "int8 ok")
    with pytest.raises(TypeDiffersError, match=rf"MD5 sum {'0' * 32}, here it is {md5(OLD)} \(from {tmp_path}/one.*ROS_BRIDGE_ROS1_SHARE"):
        types.message("own_msgs/M", md5sum="0" * 32)
    with pytest.raises(TypeDiffersError, match="own_msgs/S: its node in ROS 1 has a definition with MD5 sum 0000"):
        types.service("own_msgs/S", md5sum="0" * 32)


class Node:
    """A node in ROS 1 that says something about its topic, and counts how often it was asked."""

    def __init__(self, *headers):
        self.headers = headers
        self.asked = 0

    def __call__(self, topic):
        self.asked += 1
        return self.headers


def checked(types, node):
    found = CheckedTypes(types, node)
    found.look_at(Ros1Graph({"/m": NODE}))
    return found


def test_a_node_is_not_asked_for_a_type_that_is_known(tmp_path):
    node = Node(said(OLD))
    types = checked(types_of(tmp_path, {"own_msgs/M": OLD}, {"own_msgs/M": OLD}), node)
    for _ in range(3):
        assert types.pair("own_msgs/M", None, "/m").md5sum == ""
    assert node.asked == 0


def test_a_driver_with_a_new_version_is_bridged_as_soon_as_it_is_refused(tmp_path):
    """The connection is refused by its sum; the node is asked, and its definition counts from then on."""
    node = Node(said(OLD))
    types = checked(types_of(tmp_path, {"own_msgs/M": OLD}, {"own_msgs/M": OLD}), node)
    assert types.pair("own_msgs/M", None, "/m").notes == ()
    for text, notes in ((NEW, ("only ROS 1 has field 'c'",)), (OLD, ()), (NEW, ("only ROS 1 has field 'c'",))):
        node.headers = (said(text),)
        types.doubt("/m")
        for _ in range(2):
            pair = types.pair("own_msgs/M", None, "/m")
            assert (pair.md5sum, pair.notes) == (md5(text), notes)
    assert node.asked == 3
    types.look_at(Ros1Graph())  # it goes, and what it has said goes with it
    types.look_at(Ros1Graph({"/m": NODE}))
    assert types.pair("own_msgs/M", None, "/m").md5sum == ""


def test_a_second_publisher_of_another_version_does_not_turn_the_route_around(tmp_path):
    types = checked(types_of(tmp_path, {"own_msgs/M": OLD}, {"own_msgs/M": OLD}), Node(said(NEW), said(OLD)))
    for _ in range(3):
        types.doubt("/m")
        assert types.pair("own_msgs/M", None, "/m").md5sum == md5(NEW)


def test_a_type_that_only_its_publisher_knows_is_asked_for_once_and_when_another_publishes(tmp_path):
    node = Node()
    types = checked(types_of(tmp_path, {}, {"own_msgs/M": "int64 z\nint32 a\n"}, TypeRules(rules=[rule("z")])), node)
    for _ in range(3):
        with pytest.raises(TypeUnknownError, match="its publisher's definition of own_msgs/M: it says none"):
            types.pair("own_msgs/M", None, "/m")
    assert node.asked == 1
    node.headers = (said("int8 a b c"),)
    types.look_at(Ros1Graph({"/m": frozenset({"/another"})}))
    with pytest.raises(TypeUnknownError, match=r"its publisher's definition of own_msgs/M: .* can't be a ROS 1 field"):
        types.pair("own_msgs/M", None, "/m")
    assert node.asked == 2
    node.headers = (said("int32 a\nint64 y"),)
    types.look_at(Ros1Graph({"/m": NODE}))
    assert types.pair("own_msgs/M", None, "/m").md5sum == md5("int32 a\nint64 y")


def rule(field):
    return TypeRule("own_msgs/M", "own_msgs/M", {"y": field})


def test_a_refused_type_is_asked_for_again_after_a_while(tmp_path, monkeypatch):
    node, now_s = Node(said("", md5sum="1" * 32)), [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now_s[0])
    types = checked(types_of(tmp_path, {"own_msgs/M": OLD}, {"own_msgs/M": OLD}), node)
    types.doubt("/m")
    for _ in range(2):
        with pytest.raises(TypeDiffersError, match="MD5 sum 1111"):
            types.pair("own_msgs/M", None, "/m")
    node.headers = (said(NEW),)
    now_s[0] += ASK_AGAIN_S + 1
    assert types.pair("own_msgs/M", None, "/m").md5sum == md5(NEW)
    assert node.asked == 2


FOLLOW1 = "own_msgs/Point[] path\nfloat64 tolerance\n---\nint32 error_code\n---\nHeader header\n"
FOLLOW2 = "Point[] path\nPoint[] more\nfloat64 tolerance\n---\nint32 error_code\nstring error_string\n---\nstd_msgs/Header header\n"
HEADER_SUM, STATUS_SUM = "2176decaecbce78abc3b96ef049fabed", "d388f9b87b3c471f784434d671988d4a"
GOAL_ID_SUM = "302881f31927c1df708a2dbab0e80ee8"
RESULT_SUM = md5(f"{HEADER_SUM} header\n{STATUS_SUM} status\n{md5('int32 error_code')} result")
POINT = {"own_msgs/Point": "float64 x\n"}


def test_an_action_whose_versions_differ_is_paired_by_its_files(tmp_path):
    types = types_of(tmp_path, {"own_msgs/action/Follow": FOLLOW1, **POINT}, {"own_msgs/action/Follow": FOLLOW2, **POINT})
    action = action_type(types, "own_msgs/Follow", "own_msgs/Follow")
    notes = [part.pair.notes for part in action.parts]
    assert notes == [("only ROS 2 has field 'more'",), ("only ROS 2 has field 'error_string'",), ()]
    goal = struct.pack("<Idd", 1, 0.5, 2.0)
    assert bytes(action.goal.pair.to_ros1(action.goal.pair.to_ros2(goal))) == goal


def test_an_action_whose_server_says_its_parts_is_paired_by_them(tmp_path):
    """What a server publishes has the definitions of result and feedback; of the goal only files tell."""
    types = types_of(
        tmp_path,
        {"own_msgs/FollowGoal": "own_msgs/Point[] path\nfloat64 tolerance\n", **POINT},
        {"own_msgs/action/Follow": FOLLOW2, **POINT},
    )
    envelope = "Header header\nactionlib_msgs/GoalStatus status\nFollowResult result"
    texts = {"/follow/result": ("own_msgs/FollowActionResult", f"{envelope}{SEPARATOR}MSG: own_msgs/FollowResult\nint32 error_code\n")}
    asked = []

    def headers(topic):
        asked.append(topic)
        name, text = texts.get(topic, ("", ""))
        return [{"type": name, "md5sum": RESULT_SUM, "message_definition": text}]

    known = CheckedTypes(types, headers)
    known.look_at(Ros1Graph({f"/follow/{part}": NODE for part in ("status", "feedback", "result", "goal")}))
    before = known.action(None, "own_msgs/Follow", "/other")
    pair = known.action("own_msgs/Follow", None, "/follow")
    assert "only ROS 2 has field 'error_string'" in pair.notes
    assert pair.md5sum != before.md5sum
    assert asked == ["/follow/feedback", "/follow/result"]  # the client takes a connection for a server's
    known.action("own_msgs/Follow", None, "/follow")
    assert len(asked) == 2


def test_types_of_other_names_need_a_rule(tmp_path):
    types = checked(types_of(tmp_path, {}, {}), Node())
    for one, two in (("geometry_msgs/Point", "geometry_msgs/Vector3"), ("std_msgs/Empty", "std_msgs/String")):
        with pytest.raises(TypeDiffersError, match=rf"it is {one} in ROS 1 and {two} in ROS 2; .*\{{ros1: {one}, ros2: {two}\}}"):
            types.pair(one, two, "/m")
    ruled = checked(types_of(tmp_path, {}, {}, TypeRules(rules=[TypeRule("geometry_msgs/Point", "geometry_msgs/Vector3")])), Node())
    assert ruled.pair("geometry_msgs/Point", "geometry_msgs/Vector3", "/m").ros2_type == "geometry_msgs/Vector3"
    assert types.pair("tf/tfMessage", "tf2_msgs/TFMessage", "/m").ros1_type == "tf/tfMessage"


def test_a_subscriber_says_its_version_when_it_is_turned_away(tmp_path):
    node = Node()
    types = CheckedTypes(types_of(tmp_path, {}, {"own_msgs/M": OLD}), node)
    subscribed = Ros1Graph({}, {"/m": frozenset({"/one", "/two"})})

    def look():
        types.look_at(subscribed)
        return types.pair(None, "own_msgs/M", "/m").md5sum

    assert look() == ""
    types.hear({**said(NEW), "topic": "/m", "callerid": "/one"})
    assert [look(), look()] == [md5(NEW)] * 2
    types.hear({**said("int32 b"), "topic": "/m", "callerid": "/two"})
    assert look() == md5(NEW)  # the route has a subscriber that it suits
    types.hear({**said("int32 b"), "topic": "/m", "callerid": "/one"})
    assert look() == md5("int32 b")  # it has come back with another version
    types.look_at(Ros1Graph())
    assert look() == ""
    types.hear({**said("", md5sum=md5(OLD)), "topic": "/m", "callerid": "/two"})  # roscpp says the sum alone
    assert look() == md5(OLD)


def test_the_server_of_an_action_says_its_goal_when_it_is_turned_away(tmp_path):
    types = CheckedTypes(types_of(tmp_path, {}, {"own_msgs/action/Follow": FOLLOW2, **POINT}), Node())
    graph = Ros1Graph({}, {"/follow/goal": NODE})
    types.look_at(graph)
    before = types.action("own_msgs/Follow", None, "/follow")
    goal = "float64 tolerance\n"
    text = f"Header header\nactionlib_msgs/GoalID goal_id\nFollowGoal goal{SEPARATOR}MSG: own_msgs/FollowGoal\n{goal}"
    md5sum = md5(f"{HEADER_SUM} header\n{GOAL_ID_SUM} goal_id\n{md5(goal.strip())} goal")
    types.hear({**said(text, "own_msgs/FollowActionGoal", md5sum), "topic": "/follow/goal", "callerid": "/server"})
    types.look_at(graph)
    after = types.action("own_msgs/Follow", None, "/follow")
    assert before.notes == ()
    assert after.notes == ("only ROS 2 has field 'path'", "only ROS 2 has field 'more'")
    assert after.md5sum != before.md5sum
