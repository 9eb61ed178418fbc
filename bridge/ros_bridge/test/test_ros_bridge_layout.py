"""Layout programs, run by the native data plane, against an obvious converter, rosbags and rclpy; and against garbage."""

import ctypes
import struct

import numpy as np
import pytest
from geometry_msgs.msg import Point32, Polygon, PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Image, JointState, PointCloud2, PointField
from std_msgs.msg import Empty, Float64MultiArray

from ros_bridge import layout, native
from ros_bridge.conversion import Types, ament_prefixes

NUMBERS = {"bool": "?", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"}
NUMBERS |= {"int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
HEADER = (("seq", "uint32", None), ("stamp", "time", None), ("frame_id", "string", None))


@pytest.fixture(scope="module")
def library():
    return native.load_library()


def convert(function, program, data, *more):
    """Run a program; return None when the bytes are no message."""
    words = (ctypes.c_uint32 * len(program))(*program)
    size = function(words, len(program) // 4, data, len(data), *more, None)
    assert size >= -1
    if size < 0:
        return None
    out = (ctypes.c_uint8 * (size + 1))()
    out[size] = 0xA5  # a guard behind the end
    assert function(words, len(program) // 4, data, len(data), *more, out) == size
    assert out[size] == 0xA5
    return bytes(out)[:size]


def to_cdr(library, program, ros1):
    return convert(library.to_cdr, program, ros1)


def to_ros1(library, program, cdr, sequence=0):
    return convert(library.to_ros1, program, cdr, sequence)


# A definition is a list of (name, type, length): the type a primitive, "string", "time", "header" or such a list; the length None for
# one value, 0 for a sequence, else that of an array.
def obvious(fields, values, *, cdr, out=None):
    """Serialize value by value, as the two specifications say."""
    out = bytearray() if out is None else out
    for (_, kind, length), value in zip(fields, values, strict=True):
        if length is None:
            one(kind, value, cdr, out)
            continue
        if length == 0:
            number("I", len(value), cdr, out)
        for item in value:
            one(kind, item, cdr, out)
    return out


def one(kind, value, cdr, out):
    if kind == "header":
        one(list(HEADER[1:]) if cdr else list(HEADER), value[1:] if cdr else value, cdr, out)
    elif kind == "time":
        for part in value:
            number("I", part, cdr, out)
    elif kind == "string":
        text = value.encode()
        number("I", len(text) + cdr, cdr, out)
        out += text + b"\0" * cdr
    elif isinstance(kind, list):
        obvious(kind, value, cdr=cdr, out=out)
        if not kind and cdr:
            out += b"\0"
    else:
        number(NUMBERS[kind], value, cdr, out)


def number(code, value, cdr, out):
    if cdr:
        out += b"\0" * (-len(out) % struct.calcsize(code))
    out += struct.pack(f"<{code}", value)


def definitions(depth=2):
    primitive = st.sampled_from([*NUMBERS, "string", "time"])
    kinds = primitive if depth == 0 else primitive | definitions(depth - 1)
    field = st.tuples(st.just(""), kinds, st.sampled_from([None, None, 0, 1, 3]))
    return st.lists(field, max_size=5)


def values_of(fields):
    return st.tuples(*[value_of(kind) if length is None else items(kind, length) for _, kind, length in fields]).map(list)


def items(kind, length):
    return st.lists(value_of(kind), min_size=length, max_size=length or 4)


def value_of(kind):
    if isinstance(kind, list):
        return values_of(kind)
    if kind == "header":
        return st.tuples(st.integers(0, 2**32 - 1), value_of("time"), value_of("string")).map(list)
    if kind == "time":
        return st.tuples(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1)).map(list)
    if kind == "string":
        return st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)
    if kind == "bool":
        return st.booleans()
    if kind.startswith("float"):
        return st.floats(width=int(kind[5:]), allow_nan=False)
    bits = int(kind.lstrip("uint"))
    return st.integers(0, 2**bits - 1) if kind[0] == "u" else st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def registered(fields):
    """Register a definition and its parts with rosbags; return its fielddefs and name."""
    store = get_typestore(Stores.ROS2_JAZZY)
    table = dict(store.fielddefs)
    names = iter(range(1000))

    def register(parts):
        name = f"fuzz_msgs/msg/Part{next(names)}"
        lines = []
        for index, (_, kind, length) in enumerate(parts):
            base = {"time": "builtin_interfaces/Time", "header": "std_msgs/Header"}.get(str(kind), kind)
            if isinstance(kind, list):
                base = register(kind).replace("/msg/", "/")
            bracket = "" if length is None else "[]" if length == 0 else f"[{length}]"
            lines.append(f"{base}{bracket} field{index}")
        table.update(get_types_from_msg("\n".join(lines) or "uint8 structure_needs_at_least_one_member", name))
        return name

    return register(fields), table


@settings(max_examples=150)
@given(st.data(), st.booleans(), definitions())
def test_any_message_of_any_definition_both_ways(library, data, with_header, fields):
    fields = [("", "header", None), *fields] if with_header else fields
    name, table = registered(fields)
    program = layout.compile_program(table, name)
    values = data.draw(values_of(fields))
    ros1, cdr = obvious(fields, values, cdr=False), obvious(fields, values, cdr=True) or bytearray(1)
    assert to_cdr(library, program, bytes(ros1)) == cdr
    back = to_ros1(library, program, bytes(cdr), sequence=values[0][0] if with_header else 0)
    if not any_inner_header(fields):
        assert back == ros1
    # Cut off anywhere it is no message; with more behind it, ROS 1 says no and CDR, which may be padded, takes it.
    cut = data.draw(st.integers(0, max(len(ros1) - 1, 0)))
    if ros1:
        assert to_cdr(library, program, bytes(ros1[:cut])) is None
    assert to_cdr(library, program, bytes(ros1) + b"\0") is None
    assert to_ros1(library, program, bytes(cdr) + b"\0\0\0", sequence=values[0][0] if with_header else 0) == back


def any_inner_header(fields):
    return any(isinstance(kind, list) and any(part[1] == "header" for part in kind) for _, kind, _ in fields)


@settings(max_examples=300)
@given(definitions(), st.binary(max_size=200))
def test_garbage_is_refused_or_converted_but_never_read_beyond(library, fields, garbage):
    name, table = registered(fields)
    program = layout.compile_program(table, name)
    converted = to_cdr(library, program, garbage)
    if converted is not None:
        assert to_ros1(library, program, converted) is not None
    to_ros1(library, program, garbage)


def test_huge_counts_are_refused_at_once(library):
    for text in ("uint8[] a", "string[] a", "float64[] a", "geometry_msgs/Pose[] a", "std_msgs/Empty[] a", "std_msgs/Header[] a"):
        table = {**get_typestore(Stores.ROS2_JAZZY).fielddefs, **get_types_from_msg(text, "fuzz_msgs/msg/Huge")}
        program = layout.compile_program(table, "fuzz_msgs/msg/Huge")
        for count in (0xFFFFFFFF, 0x80000000, 0x20000001):
            assert to_cdr(library, program, struct.pack("<I", count) + b"\0" * 16) is None
            assert to_ros1(library, program, struct.pack("<I", count) + b"\0" * 16) is None


def test_wrong_programs_are_refused(library):
    words = [[9, 0, 0, 0], [0, 3, 4, 0], [0, 0, 4, 0], [1, 4, 0, 0], [5, 2, 5, 0], [6, 0, 0, 0], [5, 1, 0xFFFFFFFF, 0]]
    for program in words:
        data = (ctypes.c_uint32 * 4)(*program)
        assert library.to_cdr(data, 1, b"\0" * 64, 64, None) == -2


def image():
    message = Image(height=2, width=3, encoding="bgr8", step=9, data=np.arange(18, dtype=np.uint8).tobytes())
    message.header.frame_id = "zed"
    return message


def cloud():
    fields = [PointField(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyz")]
    return PointCloud2(height=1, width=2, fields=fields, point_step=12, row_step=24, data=bytes(range(24)), is_dense=True)


MESSAGES = {
    "sensor_msgs/Image": image(),
    "sensor_msgs/PointCloud2": cloud(),
    "geometry_msgs/PoseStamped": PoseStamped(),
    "geometry_msgs/Polygon": Polygon(points=[Point32(x=1.0), Point32(y=2.0)]),
    "sensor_msgs/JointState": JointState(name=["a", "bc"], position=[1.0, 2.0], velocity=[3.0], effort=[4.0]),
    "std_msgs/Float64MultiArray": Float64MultiArray(data=[1.0, -2.0]),
    "std_msgs/Empty": Empty(),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_real_messages_equal_what_rclpy_and_rosbags_make(library, name):
    pair = Types(ament_prefixes()).message(name)
    cdr = bytes(serialize_message(MESSAGES[name]))
    ros1 = bytes(pair.to_ros1(cdr, seq=7))
    assert to_ros1(library, pair.program, cdr[4:], sequence=7) == ros1
    converted = to_cdr(library, pair.program, ros1)
    assert converted == pair.to_ros2(ros1)[4:]
    assert deserialize_message(b"\0\1\0\0" + converted, type(MESSAGES[name])) == MESSAGES[name]


def test_empty_sequences_are_not_aligned(library):
    """As Fast CDR does it: 44 bytes of what rclpy makes of an empty JointState are 32 of message."""
    pair = Types(ament_prefixes()).message("sensor_msgs/JointState")
    cdr = bytes(serialize_message(JointState()))
    ros1 = to_ros1(library, pair.program, cdr[4:])
    assert ros1 == bytes(32)
    assert to_cdr(library, pair.program, ros1) == bytes(8) + struct.pack("<I", 1) + bytes(20)


def test_an_image_is_a_handful_of_operations():
    program = Types(ament_prefixes()).message("sensor_msgs/Image").program
    assert [layout.Code(code).name for code in program[::4]] == [
        "SEQUENCE_NUMBER", "FIXED", "STRING", "FIXED", "STRING", "FIXED", "FIXED", "SEQUENCE",
    ]  # fmt: skip


def test_types_without_a_counterpart_in_ros1_are_named():
    table = {**get_typestore(Stores.ROS2_JAZZY).fielddefs, **get_types_from_msg("float128 a", "fuzz_msgs/msg/Long")}
    with pytest.raises(Exception, match="float128"):
        layout.compile_program(table, "fuzz_msgs/msg/Long")
