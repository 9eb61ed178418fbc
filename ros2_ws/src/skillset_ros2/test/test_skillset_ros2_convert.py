"""Plain values into messages of the ROS 2 world, into inputs without message classes, and the limits of numbers."""

from __future__ import annotations

import math

import pytest
from geometry_msgs.msg import Point, PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, Int8, UInt8MultiArray, UInt64

from alula.common.plain import to_plain
from alula.model.model import Parameter
from alula.model.ros_types import INTEGER_RANGES
from alula.runtime import fitting
from alula.runtime.local.values import fit
from skillset_ros2.convert import fields_of, fill, message_class, values_of

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def test_types_are_found_by_either_worlds_name():
    assert message_class("geometry_msgs/Point") is message_class("geometry_msgs/msg/Point") is Point


@given(NUMBERS, NUMBERS, NUMBERS)
def test_a_point_is_three_numbers_and_comes_back_as_a_dict(x, y, z):
    message = fill(PoseStamped().pose, {"position": (x, y, z)}, "a pose")
    assert values_of(message.position) == {"x": x, "y": y, "z": z} == to_plain(message.position)


def test_what_fits():
    message = fill(JointState(), {"position": [1, 2.5], "name": ["a"], "header": {"stamp": {"sec": 3, "nanosec": 4}}}, "joints")
    assert (list(message.position), message.name) == ([1.0, 2.5], ["a"])
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert fields_of(Point) == {"x": "double", "y": "double", "z": "double"}
    assert list(fill(UInt8MultiArray(), {"data": [0, 255]}, "it").data) == [0, 255]


@pytest.mark.parametrize(
    ("message", "values", "error"),
    [
        (Point(), {"w": 1}, "a goal has no 'w'; it has x, y, z"),
        (Point(), {"x": "far"}, r"a goal, x takes a number \(double\), not 'far'"),
        (Point(), {"x": True}, r"a goal, x takes a number \(double\), not True"),
        (Int8(), {"data": 128}, r"a goal, data takes a whole number from -128 to 127 \(int8\), not 128"),
        (UInt64(), {"data": 1.5}, r"a goal, data takes a whole number from 0 to 18446744073709551615 \(uint64\), not 1.5"),
        (Bool(), {"data": 1}, "a goal, data takes a boolean, not 1"),
        (JointState(), {"name": "one"}, r"a goal, name takes a list \(sequence<string>\), not 'one'"),
        (JointState(), {"position": [0, "x"]}, r"a goal, position\[1\] takes a number \(double\), not 'x'"),
        (Header(), {"frame_id": 3}, "a goal, frame_id takes a string, not 3"),
        (PoseStamped().pose, {"position": (1, 2)}, r"a goal, position takes a geometry_msgs/Point or three numbers, not \(1, 2\)"),
    ],
)
def test_what_does_not_fit_is_told_with_its_place(message, values, error):
    with pytest.raises(ValueError, match=error):
        fill(message, values, "a goal")


@pytest.mark.parametrize("kind", INTEGER_RANGES)
def test_whole_numbers_reach_to_their_limits_and_no_further(kind):
    low, high = INTEGER_RANGES[kind]
    declared = [Parameter("n", kind)]
    for value in (low, high):
        assert fitting.whole_number(value, kind, "it", (low, high)) == value
        assert fit(declared, {"n": value}, "it", {}) == {"n": value}
    for value in (low - 1, high + 1, math.inf, -math.inf, math.nan, 0.5, True, "1"):
        with pytest.raises(ValueError, match=r"it takes a (whole )?number .*, not "):
            fitting.whole_number(value, kind, "it", (low, high))
        with pytest.raises(ValueError, match=r"it, n takes a (whole )?number .*, not "):
            fit(declared, {"n": value}, "it", {})
