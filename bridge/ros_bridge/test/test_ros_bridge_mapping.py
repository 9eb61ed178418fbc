"""Types that differ between the worlds: mapped by their names, by rules of a mapping, or refused by the field that has no counterpart."""

import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.definitions import DefinitionFiles
from ros_bridge.errors import TypeDiffersError, TypeUnknownError, WireError
from ros_bridge.mapping import TypeRule, TypeRules
from ros_bridge.ros1_definition import md5


def write(folder, name, text, kind="msg"):
    package, short = name.split("/")
    path = folder / package / kind / f"{short}.{kind}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.fixture
def world(tmp_path):
    """Return a function that makes Types of ROS 1 definitions and ROS 2 definitions, both ``{package/Name: text}``."""

    def make(ros1, ros2, rules=None):
        for folder, texts in (("ros1", ros1), ("ros2/share", ros2)):
            for name, text in texts.items():
                write(tmp_path / folder, name, text)
        return Types([tmp_path / "ros2"], rules, DefinitionFiles([tmp_path / "ros1"]))

    return make


def ros2_bytes(texts, name, **values):
    """Serialize with rosbags alone, as a reference."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for known, text in texts.items():
        store.register(get_types_from_msg(text, known.replace("/", "/msg/")))
    message = store.types[name.replace("/", "/msg/")](**values)
    return bytes(store.serialize_cdr(message, name.replace("/", "/msg/"))), store


def test_legacy_tf_message_is_tf2s():
    pair = Types(ament_prefixes()).message("tf/tfMessage")
    assert (pair.ros2_name, pair.same_layout) == ("tf2_msgs/TFMessage", True)
    assert pair.md5sum == "94810edda583a504dfda3829e70d7eec"  # what `rosmsg md5 tf/tfMessage` prints
    assert "MSG: geometry_msgs/TransformStamped" in pair.full_text
    rules = TypeRules()
    assert rules.to_ros1("tf2_msgs/TFMessage") == "tf2_msgs/TFMessage"


def test_a_log_message_becomes_ros2s_and_returns_with_what_both_have():
    pair = Types(ament_prefixes()).message("rosgraph_msgs/Log")
    assert (pair.ros2_name, pair.same_layout) == ("rcl_interfaces/Log", False)
    ros1 = (
        struct.pack("<III", 9, 12, 34)  # header.seq, stamp
        + struct.pack("<I1s", 1, b"f")  # header.frame_id
        + struct.pack("<b", 4)  # level: warn
        + struct.pack("<I2s", 2, b"/n")  # name
        + struct.pack("<I3s", 3, b"msg")
        + struct.pack("<I1s", 1, b"a")  # file
        + struct.pack("<I1s", 1, b"b")  # function
        + struct.pack("<I", 7)  # line
        + struct.pack("<II1s", 1, 1, b"t")  # topics: one
    )
    cdr = pair.to_ros2(ros1)
    assert cdr[:13] == b"\x00\x01\x00\x00" + struct.pack("<IIB", 12, 34, 4)
    returned = bytes(pair.to_ros1(cdr))
    wanted = struct.pack("<IIII", 0, 12, 34, 0) + ros1[17:-9] + struct.pack("<I", 0)  # no seq, no frame, no topics
    assert returned == wanted


def test_fields_in_another_order_go_by_their_names(world):
    types = world({"a_msgs/M": "int32 one\nfloat64 two\nstring[] three\n"}, {"a_msgs/M": "string[] three\nint32 one\nfloat64 two\n"})
    pair = types.message("a_msgs/M")
    assert not pair.same_layout
    assert pair.notes == ()
    ros1 = struct.pack("<id", 5, 2.5) + struct.pack("<II2sI1s", 2, 2, b"hi", 1, b"x")
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("string[] three\nint32 one\nfloat64 two\n", "a_msgs/msg/M"))
    message = store.deserialize_cdr(pair.to_ros2(ros1), "a_msgs/msg/M")
    assert (message.one, message.two, message.three) == (5, 2.5, ["hi", "x"])
    assert bytes(pair.to_ros1(pair.to_ros2(ros1))) == ros1


def test_a_field_of_one_world_alone_is_zero_one_way_and_told(world):
    types = world({"a_msgs/M": "int32 one\n"}, {"a_msgs/M": "int32 one\ngeometry_msgs/Point[2] more\nfloat32[3] numbers\n"})
    pair = types.message("a_msgs/M")
    assert pair.notes == ("only ROS 2 has field 'more'", "only ROS 2 has field 'numbers'")
    cdr = pair.to_ros2(struct.pack("<i", 5))
    assert cdr == b"\x00\x01\x00\x00" + struct.pack("<i4x", 5) + bytes(48) + bytes(12)
    assert bytes(pair.to_ros1(cdr)) == struct.pack("<i", 5)


@pytest.mark.parametrize(
    ("ros1", "ros2", "words"),
    [
        ("int32 one\nint32 old\n", "int32 one\nint32 new\n", ["a_msgs/M differs", "'old'", "'new'", "{old: new}"]),
        ("int32 one\nint8 x\n", "int32 one\nint64 x\n", ["field 'x' is int8 in ROS 1", "'x' is int64 in ROS 2"]),
        ("int32[3] one\nint8 x\n", "int8 x\nint32[4] one\n", [r"field 'one' is int32\[3\] in ROS 1", r"int32\[4\] in ROS 2"]),
        (
            "time at\nint8 x\n",
            "int8 x\nbuiltin_interfaces/Duration at\n",
            ["builtin_interfaces/Time in", "builtin_interfaces/Duration"],
        ),
        ("geometry_msgs/Point p\nint8 x\n", "int8 x\ngeometry_msgs/Vector3 p\n", ["geometry_msgs/Point in ROS 1", "geometry_msgs/Vector3"]),
    ],
)
def test_a_field_without_a_place_in_the_other_type_is_refused_by_name(world, ros1, ros2, words):
    if ros1.startswith("int32 one\nint32 old"):  # the same layout under other names is no problem ...
        assert world({"a_msgs/Same": ros1}, {"a_msgs/Same": ros2}).message("a_msgs/Same").same_layout
        ros1, ros2 = ros1 + "int8 x\n", "int8 x\n" + ros2  # ... but another order is
    types = world({"a_msgs/M": ros1}, {"a_msgs/M": ros2})
    for word in words:
        with pytest.raises(TypeDiffersError, match=word):
            types.message("a_msgs/M")


def test_a_mapping_renames_packages_messages_and_nested_fields(world):
    rules = TypeRules(
        {"old_msgs": "new_msgs"},
        [TypeRule("old_msgs/Track", "new_msgs/TrackInfo", {"head.at": "stamp", "head.where": "place.x", "size": "count", "junk": ""})],
    )
    types = world(
        {
            "old_msgs/Track": "Head head\nuint8 size\nPart[] parts\nstring junk\nduration age\n",
            "old_msgs/Head": "time at\nfloat64 where\n",
            "old_msgs/Part": "string name\nint16 x\n",
        },
        {
            "new_msgs/TrackInfo": "builtin_interfaces/Time stamp\nbuiltin_interfaces/Duration age\nuint32 count\n"
            "geometry_msgs/Point place\nPart[] parts\n",
            "new_msgs/Part": "int16 x\nstring name\n",
        },
        rules,
    )
    pair = types.message("old_msgs/Track")
    assert pair.ros2_name == "new_msgs/TrackInfo"
    assert rules.to_ros1("new_msgs/TrackInfo") == "old_msgs/Track"
    assert rules.to_ros1("new_msgs/Part") == "old_msgs/Part"
    ros1 = (
        struct.pack("<IId", 1, 2, 0.5)  # head
        + struct.pack("<B", 200)  # size
        + struct.pack("<II2sh", 1, 2, b"ab", -3)  # one part
        + struct.pack("<I4s", 4, b"lost")
        + struct.pack("<ii", -1, 5)  # age
    )
    returned = bytes(pair.to_ros1(pair.to_ros2(ros1)))
    assert returned == ros1.replace(struct.pack("<I4s", 4, b"lost"), bytes(4))
    store = types._ros2
    message = store.deserialize_cdr(pair.to_ros2(ros1), "new_msgs/msg/TrackInfo")
    assert (message.stamp.sec, message.count, message.place.x, message.parts[0].name) == (1, 200, 0.5, "ab")


def test_a_number_that_does_not_fit_is_an_error_of_the_message(world):
    rules = TypeRules(rules=[TypeRule("a_msgs/M", "a_msgs/M", {"big": "small"})])
    pair = world({"a_msgs/M": "uint32 big\n"}, {"a_msgs/M": "uint8 small\n"}, rules).message("a_msgs/M")
    assert pair.to_ros2(struct.pack("<I", 255)) == b"\x00\x01\x00\x00\xff"
    with pytest.raises(struct.error):
        pair.to_ros2(struct.pack("<I", 256))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"wrong": "one"}, "names field 'wrong', which it does not have in ROS 1"),
        ({"one": "wrong"}, "names field 'wrong', which it does not have in ROS 2"),
        ({"one.deep": "one"}, "goes into field 'one' .int32., which is no message"),
    ],
)
def test_a_mapping_that_names_no_field_is_refused(world, fields, words):
    types = world({"a_msgs/M": "int32 one\n"}, {"a_msgs/M": "int32 one\n"}, TypeRules(rules=[TypeRule("a_msgs/M", "a_msgs/M", fields)]))
    with pytest.raises(TypeDiffersError, match=words):
        types.message("a_msgs/M")


def test_what_a_publisher_says_is_its_definition(world):
    types = world({}, {"own_msgs/Outer": "Inner[] inner\n", "own_msgs/Inner": "int32 b\nint32 a\n"})
    assert not types.knows_ros1("own_msgs/Outer")
    inner = "int32 a\nint64 c\nint32 b"
    text = "Inner[] inner\n" + "=" * 80 + f"\nMSG: own_msgs/Inner\n{inner}\n"
    with pytest.raises(TypeUnknownError, match=r"the text that comes with own_msgs/Outer has MD5 sum .*, and its node says x"):
        types.learn("own_msgs/Outer", text, "x")
    types.learn("own_msgs/Outer", text, md5(f"{md5(inner)} inner"))
    assert types.knows_ros1("own_msgs/Outer")
    pair = types.message("own_msgs/Outer")
    assert not pair.same_layout
    cdr = pair.to_ros2(struct.pack("<Iiqi", 1, 1, 9, 2))
    assert cdr[4:] == struct.pack("<Iii", 1, 2, 1)


def test_ros1_definitions_are_read_from_generated_modules(tmp_path):
    module = tmp_path / "gen_msgs/msg/_Odd.py"
    module.parent.mkdir(parents=True)
    module.write_text(
        'class Odd:\n  _md5sum = "x"\n  _full_text = """int32 a\nHeader h\n' + "=" * 80 + '\nMSG: std_msgs/Header\nuint32 seq\n"""\n'
    )
    assert DefinitionFiles([], [tmp_path]).message("gen_msgs/Odd") == "int32 a\nHeader h\n"
    assert DefinitionFiles([], [tmp_path]).message("gen_msgs/Even") is None


def test_a_definition_that_can_not_be_read_is_an_error_with_its_name(world):
    with pytest.raises(TypeUnknownError, match="bad_msgs/Bad: its definition can't be read"):
        world({}, {"bad_msgs/Bad": "int32 = = 5\n"}).message("bad_msgs/Bad")


KINDS = ["bool", "int8", "uint16", "int32", "uint64", "float32", "float64", "string", "time", "duration", "geometry_msgs/Point", "uint8[]"]
VALUES = {
    "bool": st.booleans().map(lambda value: struct.pack("<?", value)),
    "string": st.text(max_size=5).map(lambda text: struct.pack("<I", len(text.encode())) + text.encode()),
    "uint8[]": st.binary(max_size=9).map(lambda data: struct.pack("<I", len(data)) + data),
    **{
        kind: st.binary(min_size=size, max_size=size)
        for kind, size in {"int8": 1, "uint16": 2, "int32": 4, "uint64": 8, "time": 8, "duration": 8}.items()
    },
    "float32": st.floats(width=32, allow_nan=False).map(lambda value: struct.pack("<f", value)),
    "float64": st.floats(allow_nan=False).map(lambda value: struct.pack("<d", value)),
    "geometry_msgs/Point": st.lists(st.floats(allow_nan=False), min_size=3, max_size=3).map(lambda values: struct.pack("<3d", *values)),
}
ROS2_KINDS = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}


@settings(max_examples=30, suppress_health_check=list(HealthCheck), database=None)
@given(st.data())
def test_any_order_of_any_fields_returns_byte_for_byte(tmp_path_factory, data):
    kinds = data.draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=6))
    fields = [(kind, f"f{number}") for number, kind in enumerate(kinds)]
    shuffled = data.draw(st.permutations(fields))
    folder = tmp_path_factory.mktemp("orders")
    write(folder / "ros1", "x_msgs/X", "".join(f"{kind} {name}\n" for kind, name in fields))
    write(folder / "ros2/share", "x_msgs/X", "".join(f"{ROS2_KINDS.get(kind, kind)} {name}\n" for kind, name in shuffled))
    pair = Types([folder / "ros2"], None, DefinitionFiles([folder / "ros1"])).message("x_msgs/X")
    ros1 = b"".join(data.draw(VALUES[kind]) for kind, _ in fields)
    assert bytes(pair.to_ros1(pair.to_ros2(ros1))) == ros1


def test_a_name_that_stands_at_another_place_is_never_paired_by_place(world):
    pair = world({"a_msgs/Swap": "float64 x\nfloat64 y\n"}, {"a_msgs/Swap": "float64 y\nfloat64 x\n"}).message("a_msgs/Swap")
    assert not pair.same_layout
    assert pair.to_ros2(struct.pack("<dd", 1.0, 2.0))[4:] == struct.pack("<dd", 2.0, 1.0)
    assert bytes(pair.to_ros1(pair.to_ros2(struct.pack("<dd", 1.0, 2.0)))) == struct.pack("<dd", 1.0, 2.0)


def test_fields_renamed_at_their_place_are_paired_and_told(world):
    ros1 = {"a_msgs/M": "uint8 a\nPart[] parts\nfloat32 temp\n", "a_msgs/Part": "float32 batteryVoltage\n"}
    ros2 = {"a_msgs/M": "uint8 a\nPart[] parts\nfloat32 heat\n", "a_msgs/Part": "float32 battery_voltage\n"}
    pair = world(ros1, ros2).message("a_msgs/M")
    assert pair.same_layout
    assert pair.notes == (
        "a_msgs/Part's field 'batteryVoltage' is 'battery_voltage' in ROS 2",
        "a_msgs/M's field 'temp' is 'heat' in ROS 2",
    )


@pytest.mark.parametrize(
    ("ros1", "ros2", "words"),
    [
        ("float64 x\nfloat64 y\nfloat64 v\n", "float64 y\nfloat64 x\nfloat64 w\n", "only ROS 1 has field 'v' and only ROS 2 has field 'w'"),
        ("float64 a\nfloat64 b\n", "float64 b\nfloat64 c\n", "only ROS 1 has field 'a' and only ROS 2 has field 'c'"),
        ("In one\nIn two\nfloat64 x\n", "In two\nIn one\nfloat64 z\n", "only ROS 1 has field 'x' and only ROS 2 has field 'z'"),
    ],
)
def test_beside_fields_at_other_places_no_field_is_paired_by_place(world, ros1, ros2, words):
    part = {"a_msgs/In": "int8 i\n"}
    with pytest.raises(TypeDiffersError, match=words):
        world({"a_msgs/M": ros1, **part}, {"a_msgs/M": ros2, **part}).message("a_msgs/M")


def test_a_part_whose_fields_swap_makes_the_whole_go_by_names(world):
    ros1 = {"a_msgs/M": "In[] ins\nIn[2] two\nint8 z\n", "a_msgs/In": "int16 x\nint16 y\n"}
    ros2 = {"a_msgs/M": "In[] ins\nIn[2] two\nint8 z\n", "a_msgs/In": "int16 y\nint16 x\n"}
    pair = world(ros1, ros2).message("a_msgs/M")
    cdr = pair.to_ros2(struct.pack("<Ihh4hb", 1, 1, 2, 3, 4, 5, 6, 7))
    assert cdr[4:] == struct.pack("<Ihh4hb", 1, 2, 1, 4, 3, 6, 5, 7)


NAMED = st.lists(
    st.tuples(st.sampled_from(["a", "b", "cd", "c_d", "Cd", "e"]), st.sampled_from(["int32", "float32"])), min_size=1, max_size=4
)


@settings(max_examples=200, suppress_health_check=list(HealthCheck), database=None)
@given(NAMED.filter(lambda fields: len({name for name, _ in fields}) == len(fields)), st.data())
def test_no_value_arrives_in_a_field_that_the_other_world_has_elsewhere(tmp_path_factory, fields, data):
    """Fields that both worlds have under the very name get each other's values, or the type is refused."""
    others = data.draw(NAMED.filter(lambda fields: len({name for name, _ in fields}) == len(fields)))
    folder = tmp_path_factory.mktemp("named")
    for place, these in (("ros1", fields), ("ros2/share", others)):
        write(folder / place, "x_msgs/X", "".join(f"{kind} {name}\n" for name, kind in these))
    try:
        pair = Types([folder / "ros2"], None, DefinitionFiles([folder / "ros1"])).message("x_msgs/X")
    except TypeDiffersError:
        return
    ros1 = b"".join(struct.pack("<i" if kind == "int32" else "<f", number + 1) for number, (_, kind) in enumerate(fields))
    values = struct.unpack("<" + "".join("i" if kind == "int32" else "f" for _, kind in others), pair.to_ros2(ros1)[4:])
    arrived = dict(zip((name for name, _ in others), values, strict=True))
    for number, (name, _) in enumerate(fields):
        if name in arrived:
            assert arrived[name] == number + 1, (fields, others)


def test_strings_that_are_no_utf8_pass_as_bytes_where_fields_go_by_their_names(world):
    types = world({"a_msgs/M": "string one\nstring[] more\nint8 x\n"}, {"a_msgs/M": "int8 x\nstring[] more\nstring one\n"})
    ros1 = struct.pack("<I2sII1sb", 2, b"\xff\xe4", 1, 1, b"\x80", 7)
    pair = types.message("a_msgs/M")
    assert not pair.same_layout
    assert bytes(pair.to_ros1(pair.to_ros2(ros1))) == ros1
    assert b"\xff\xe4\x00" in pair.to_ros2(ros1)


@pytest.mark.parametrize("data", [b"", b"\x01", struct.pack("<i", 2**31 - 1), struct.pack("<i", -1) + bytes(8), bytes(200)])
def test_bytes_that_are_no_message_are_an_error_where_fields_go_by_their_names(world, data):
    types = world(
        {"a_msgs/M": "string one\nIn[] ins\nint8 x\n", "a_msgs/In": ""}, {"a_msgs/M": "int8 x\nIn[] ins\nstring one\n", "a_msgs/In": ""}
    )
    pair = types.message("a_msgs/M")
    for convert in (pair.to_ros2_layout, pair.to_ros1_from_layout):
        with pytest.raises(WireError, match=r"ends early|goes on behind its end"):
            convert(data)


def test_times_durations_and_uuids_have_rules():
    types = Types(ament_prefixes())
    rules = TypeRules()
    for one, two in (("std_msgs/Time", "builtin_interfaces/Time"), ("std_msgs/Duration", "builtin_interfaces/Duration")):
        assert (rules.to_ros2(one), rules.to_ros1(two)) == (two, one)
        pair = types.message(one)
        assert bytes(pair.to_ros1(pair.to_ros2(struct.pack("<II", 5, 6)))) == struct.pack("<II", 5, 6)
        assert pair.to_ros2(struct.pack("<II", 5, 6))[4:] == struct.pack("<II", 5, 6)
    assert (rules.to_ros2("uuid_msgs/UniqueID"), rules.to_ros1("unique_identifier_msgs/UUID")) == (
        "unique_identifier_msgs/UUID",
        "uuid_msgs/UniqueID",
    )
    pair = types.message("uuid_msgs/UniqueID")
    assert (pair.same_layout, bytes(pair.to_ros1(pair.to_ros2(bytes(range(16)))))) == (True, bytes(range(16)))


def test_a_field_of_a_ruled_type_follows_the_rule(world):
    pair = world({"a_msgs/M": "int8 x\nstd_msgs/Time at\n"}, {"a_msgs/M": "builtin_interfaces/Time at\nint8 x\n"}).message("a_msgs/M")
    assert pair.to_ros2(struct.pack("<bII", 7, 5, 6))[4:] == struct.pack("<IIb", 5, 6, 7)


def hint_of(error):
    """Return the mapping that a refusal proposes."""
    return dict(pair.split(": ") for pair in str(error).split("fields: {")[1].split("}")[0].split(", "))


@pytest.mark.parametrize(
    ("ros1", "ros2"),
    [
        ("int32 x\nint32 old\nint8 y\n", "int8 y\nint32 x\nint32 new\n"),
        ("int8 x\ntime data\n", "int32 sec\nuint32 nanosec\nint8 x\n"),
        ("int32 sec\nuint32 nanosec\nint8 x\n", "int8 x\nbuiltin_interfaces/Time stamp\n"),
        ("int8 n\ngeometry_msgs/Point at\n", "float64 x\nfloat64 y\nfloat64 z\nint8 n\n"),
    ],
)
def test_what_a_refusal_proposes_works(world, ros1, ros2):
    with pytest.raises(TypeDiffersError, match=r"fields: \{") as refused:
        world({"a_msgs/M": ros1}, {"a_msgs/M": ros2}).message("a_msgs/M")
    rules = TypeRules(rules=[TypeRule("a_msgs/M", "a_msgs/M", hint_of(refused.value))])
    assert world({"a_msgs/M": ros1}, {"a_msgs/M": ros2}, rules).message("a_msgs/M").notes == ()
