"""Plain values into messages of the ROS 1 world and back."""

from __future__ import annotations

import genpy
import pytest
from geometry_msgs.msg import Point, PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import BatteryState, JointState
from std_msgs.msg import Bool, Header, Int8, UInt16, UInt64

from alula.common.plain import to_plain
from skillset_ros1.convert import fields_of, fill, message_class, values_of

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def test_types_are_found_by_either_worlds_name():
    assert message_class("geometry_msgs/Point") is message_class("geometry_msgs/msg/Point") is Point


@given(NUMBERS, NUMBERS, NUMBERS)
def test_a_point_is_three_numbers_and_comes_back_as_a_dict(x, y, z):
    message = fill(PoseStamped().pose, {"position": (x, y, z)}, "a pose")
    assert values_of(message.position) == {"x": x, "y": y, "z": z} == to_plain(message.position)


@given(st.lists(NUMBERS), st.lists(st.text()))
def test_lists(positions, names):
    message = fill(JointState(), {"position": positions, "name": names}, "joints")
    assert (message.position, message.name) == (positions, names)
    assert to_plain(message)["position"] == positions


@pytest.mark.parametrize(
    ("message", "values", "error"),
    [
        (Point(), {"w": 1}, "a goal has no 'w'; it has x, y, z"),
        (Point(), {"x": "far"}, r"a goal, x takes a number \(float64\), not 'far'"),
        (Point(), {"x": True}, r"a goal, x takes a number \(float64\), not True"),
        (Int8(), {"data": 128}, r"a goal, data takes a whole number from -128 to 127 \(int8\), not 128"),
        (UInt16(), {"data": -1}, "a goal, data takes a whole number from 0 to 65535"),
        (UInt64(), {"data": 1.5}, "a goal, data takes a whole number from 0 to 18446744073709551615"),
        (Bool(), {"data": 1}, "a goal, data takes a bool, not 1"),
        (JointState(), {"name": "one"}, r"a goal, name takes a list \(string\[\]\), not 'one'"),
        (JointState(), {"position": [0, "x"]}, r"a goal, position\[1\] takes a number"),
        (Header(), {"stamp": 3}, "a goal, stamp takes a time, not 3"),
        (PoseStamped().pose, {"position": (1, 2)}, "a goal, position takes a geometry_msgs/Point or three numbers"),
    ],
)
def test_what_does_not_fit_is_told_with_its_place(message, values, error):
    with pytest.raises(ValueError, match=error):
        fill(message, values, "a goal")


def test_messages_are_told_as_in_the_other_world():
    header = Header(seq=7, stamp=genpy.Time(3, 4), frame_id="map")
    assert to_plain({"header": header}) == {"header": {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": "map"}}
    assert to_plain(BatteryState(present=1, voltage=3))["present"] is True
    assert isinstance(to_plain(BatteryState(voltage=3))["voltage"], float)
    assert fill(Header(), {"stamp": {"sec": 3, "nanosec": 4}}, "it").stamp == genpy.Time(3, 4)
    assert list(fields_of(Point)) == ["x", "y", "z"]
