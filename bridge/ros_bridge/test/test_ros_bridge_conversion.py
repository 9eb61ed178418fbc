"""Bytes survive ROS 1 -> CDR -> ROS 1 for random messages and recorded ones; sums are those that catkin generates."""

import hashlib
import json
import os
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ros_bridge_harness import bag_folder
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Reader

from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.definitions import DefinitionFiles
from ros_bridge.errors import TypeDiffersError, TypeUnknownError

ROUND_TRIPS = [
    "std_msgs/String",
    "std_msgs/Empty",
    "std_msgs/Float64MultiArray",
    "rosgraph_msgs/Clock",
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovarianceStamped",
    "sensor_msgs/Image",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/PointCloud2",
    "sensor_msgs/JointState",
    "sensor_msgs/MultiDOFJointState",
    "nav_msgs/Path",
    "tf2_msgs/TFMessage",
    "diagnostic_msgs/DiagnosticArray",
    "skillset_interfaces/ResourceStates",
    "skillset_interfaces/Event",
    "uav_msgs/GuidanceState",
    "uav_msgs/Obstacle",
    "uav_msgs/SensorHealth",
]
SCALARS = {
    "bool": st.booleans().map(lambda value: struct.pack("<?", value)),
    **{name: st.binary(min_size=size, max_size=size) for name, size in {"int8": 1, "uint8": 1, "byte": 1, "char": 1}.items()},
    **{f"{sign}int{bits}": st.binary(min_size=bits // 8, max_size=bits // 8) for sign in ("", "u") for bits in (16, 32, 64)},
    "float32": st.binary(min_size=4, max_size=4),
    "float64": st.binary(min_size=8, max_size=8),
    "string": st.text(max_size=9).map(lambda text: struct.pack("<I", len(text.encode())) + text.encode()),
}


@pytest.fixture(scope="module")
def types():
    return Types(ament_prefixes())


def ros1_bytes(types, name):
    """Serialized ROS 1 messages of a type, written from its fields alone: an obvious reference beside rosbags' generated code."""
    if name == "std_msgs/msg/Header":  # seq is lost on the way, so it is 0 here
        return st.tuples(st.just(bytes(4)), st.binary(min_size=8, max_size=8), SCALARS["string"]).map(b"".join)
    fields = [field for field in types._found.fielddefs[name][1] if field[0] != "structure_needs_at_least_one_member"]
    return st.tuples(*(field_bytes(types, kind) for _, kind in fields)).map(b"".join)


def field_bytes(types, kind):
    node, inner = kind
    if node == Nodetype.BASE:
        return SCALARS[inner[0]]
    if node == Nodetype.NAME:
        return ros1_bytes(types, inner)
    element = field_bytes(types, inner[0])
    if node == Nodetype.ARRAY:
        return st.lists(element, min_size=inner[1], max_size=inner[1]).map(b"".join)
    return st.lists(element, max_size=3).map(lambda items: struct.pack("<I", len(items)) + b"".join(items))


@pytest.mark.parametrize("name", ROUND_TRIPS)
def test_random_messages_return_byte_for_byte(types, name):
    message = types.message(name)

    @settings(max_examples=25, suppress_health_check=list(HealthCheck), database=None)
    @given(ros1_bytes(types, name.replace("/", "/msg/")))
    def round_trip(ros1):
        assert bytes(message.to_ros1(message.to_ros2(ros1))) == ros1

    round_trip()


def test_cdr_is_what_the_layout_says(types):
    # uav_msgs/SensorHealth in ROS 1, field by field ...
    ros1 = (
        struct.pack("<III", 7, 12, 34)  # header.seq, stamp.secs, stamp.nsecs
        + struct.pack("<I3s", 3, b"map")  # header.frame_id
        + struct.pack("<I3s", 3, b"zed")  # sensor
        + struct.pack("<?", True)  # ok
        + struct.pack("<I", 0)  # reason, empty
        + struct.pack("<dd", 10.0, 0.25)  # rate_hz, age_s
        + struct.pack("<B", 2)  # verdict
        + struct.pack("<I4s", 4, b"blur")  # fault
    )
    # ... and as CDR: no seq, strings end with a zero, each field aligned to its size from behind the encapsulation
    cdr = (
        b"\x00\x01\x00\x00"  # encapsulation: little endian
        + struct.pack("<II", 12, 34)
        + struct.pack("<I4s", 4, b"map\0")
        + struct.pack("<I4s", 4, b"zed\0")
        + struct.pack("<?3x", True)
        + struct.pack("<I1s", 1, b"\0")
        + bytes(7)  # to 8 bytes
        + struct.pack("<dd", 10.0, 0.25)
        + struct.pack("<B3x", 2)
        + struct.pack("<I5s", 5, b"blur\0")
    )
    health = types.message("uav_msgs/SensorHealth")
    assert health.to_ros2(ros1).hex() == cdr.hex()
    assert bytes(health.to_ros1(cdr)) == bytes(4) + ros1[4:]


def test_sequence_number_is_set_in_a_leading_header_only(types):
    header = types.message("std_msgs/Header")
    pose = types.message("geometry_msgs/PoseStamped")
    pose_cdr = pose.to_ros2(bytes(4 + 8 + 4 + 56))
    assert not header.begins_with_header
    assert pose.begins_with_header
    assert bytes(pose.to_ros1(pose_cdr, seq=258))[:4] == b"\x02\x01\x00\x00"
    string = types.message("std_msgs/String")
    text = struct.pack("<I2s", 2, b"hi")
    assert bytes(string.to_ros1(string.to_ros2(text), seq=258)) == text


MESSAGES = sorted({*ROUND_TRIPS, "uav_msgs/MappingState", "skillset_interfaces/ResourceState"} - {"diagnostic_msgs/DiagnosticArray"})
SERVICES = [
    "std_srvs/SetBool",
    "std_srvs/Trigger",
    "std_srvs/Empty",
    "nav_msgs/GetPlan",
    "uav_msgs/Takeoff",
    "uav_msgs/Command",
    "uav_msgs/SetPositionReference",
    "uav_msgs/SetHeadingReference",
    "uav_msgs/CheckFence",
    "uav_msgs/SetSensor",
    "skillset_interfaces/Transition",
    "skillset_interfaces/Describe",
    "skillset_interfaces/GetData",
]
ASK_CATKIN = """
import json, sys, roslib.message as m
names = json.loads(sys.argv[1])
print(json.dumps({n: (m.get_message_class(n) or m.get_service_class(n))._md5sum for n in names}))
"""


@pytest.fixture(scope="module")
def catkin_sums():
    command = [str(Path(os.environ["ALULA_ROOT"]) / "setup/in_ros1"), "python3", "-c", ASK_CATKIN, json.dumps(MESSAGES + SERVICES)]
    return json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


@pytest.mark.parametrize("name", MESSAGES)
def test_message_sums_are_catkins(types, catkin_sums, name):
    assert types.message(name).md5sum == catkin_sums[name]


@pytest.mark.parametrize("name", SERVICES)
def test_service_sums_are_catkins(types, catkin_sums, name):
    assert types.service(name).md5sum == catkin_sums[name]


def package(prefix: Path, name: str, **files: str) -> Path:
    for file, text in files.items():
        kind, short = file.split("_", 1)
        path = prefix / "share" / name / kind / f"{short}.{kind}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return prefix


def test_constants_count_for_the_sum_as_they_are_written(tmp_path):
    # The sum of the text below by the rule, by hand: constants first, comments gone but not out of a string.
    text = "int32 a # x\nstring GREETING=hi # there\nfloat64 TINY=1e-3\nuint8 MASK = 0x10\nHeader header\n"
    one = Types([package(tmp_path, "odd_msgs", msg_Odd=text)]).message("odd_msgs/Odd")
    wanted = "string GREETING=hi # there\nfloat64 TINY=1e-3\nuint8 MASK=0x10\nint32 a\n2176decaecbce78abc3b96ef049fabed header"
    assert one.md5sum == hashlib.md5(wanted.encode(), usedforsecurity=False).hexdigest()
    assert not one.begins_with_header
    assert "MSG: std_msgs/Header" in one.full_text


@pytest.mark.parametrize("line", ["uint8 MASK=0x10", "float64 TINY=1e-3", "bool ON=true", "int32 class_"])
def test_rosbags_own_sum_is_not_ros_1s(tmp_path, line):
    """Why the bridge has sums of its own (``ros1_definition``): when this fails, rosbags' are good enough."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(line, "odd_msgs/msg/Odd"))
    md5sum = hashlib.md5(line.encode(), usedforsecurity=False).hexdigest()  # the rule, for a text without comments and blanks
    assert store.generate_msgdef("odd_msgs/msg/Odd")[1] != md5sum
    assert Types([package(tmp_path, "odd_msgs", msg_Odd=line)]).message("odd_msgs/Odd").md5sum == md5sum


def test_unknown_types_say_where_was_looked_and_what_to_do(tmp_path):
    types = Types([tmp_path])
    with pytest.raises(TypeUnknownError, match=r"no_msgs/No: no no_msgs/msg/No.msg in .*share; build the package"):
        types.message("no_msgs/No")
    with pytest.raises(TypeUnknownError, match=r"no_msgs/No: no no_msgs/srv/No.srv"):
        types.service("no_msgs/No")


@pytest.mark.parametrize("line", ["string<=5 name", "int32[<=3] items", "int32 five 5"])
def test_fields_that_ros1_does_not_have(tmp_path, line):
    with pytest.raises(TypeUnknownError, match="can't be a ROS 1 field"):
        Types([package(tmp_path, "new_msgs", msg_New=line)]).message("new_msgs/New")


def test_a_type_that_differs_is_refused_by_name_and_field(tmp_path):
    ros2 = package(tmp_path / "ros2", "own_msgs", msg_Outer="Inner[] inner\n", msg_Inner="int32 a\nint32 b\n")
    ros1 = package(tmp_path / "ros1", "own_msgs", msg_Outer="Inner[] inner\n", msg_Inner="int32 a\nfloat32 b\n")
    types = Types([ros2], None, DefinitionFiles([ros1 / "share"]))
    with pytest.raises(TypeDiffersError, match=r"own_msgs/Inner differs: field 'b' is float32 in ROS 1, 'b' is int32 in ROS 2"):
        types.message("own_msgs/Outer")


BAGS = bag_folder()
PER_CONNECTION = 200


@pytest.mark.parametrize("name", ["embag_luminar_pointcloud2.bag", "foxglove_turtlesim.bag", "robot_localization_test1.bag"])
def test_recorded_messages_return_byte_for_byte(types, name):
    path = BAGS / name
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    converted = 0
    with Reader(path) as reader:
        for connection in reader.connections:
            ros1_name = connection.msgtype.replace("/msg/", "/")
            try:
                message = types.message(ros1_name)
            except TypeUnknownError:
                continue  # the recorder's own types
            if not message.same_layout:
                continue  # what a mapping leaves out does not return
            assert message.md5sum == connection.digest, f"{ros1_name} is another than the recorded one"
            for number, (_, _, ros1) in enumerate(reader.messages([connection])):
                if number == PER_CONNECTION:
                    break
                returned = bytes(message.to_ros1(message.to_ros2(ros1)))
                start = 4 if message.begins_with_header else 0
                assert len(returned) == len(ros1)
                if "Header" not in message.full_text or message.begins_with_header:
                    assert returned[start:] == ros1[start:], ros1_name
                converted += 1
    assert converted > 0
