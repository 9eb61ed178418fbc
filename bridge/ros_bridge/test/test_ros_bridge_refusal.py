"""How a response says no, as bytes."""

import struct

from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from ros_bridge_service_peers import TYPES
from std_srvs.srv import Empty, SetBool
from uav_msgs.srv import SetSensor

from ros_bridge.services import Refusal, refusal, refusal_around


@given(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=300))
def test_refusal_is_the_bytes_of_a_response_that_says_no(reason):
    for name, kind in (("uav_msgs/SetSensor", SetSensor), ("std_srvs/SetBool", SetBool)):
        convert = TYPES.service(name).response.to_layout
        no = refusal_around(kind.Response, convert)
        assert (no.has_flag, no.has_text) == (True, True)
        wanted = convert(serialize_message(refusal(kind.Response, reason)))
        assert no.before + struct.pack("<I", len(reason.encode())) + reason.encode() + no.after == wanted


def test_response_without_a_flag_has_no_refusal():
    assert refusal_around(Empty.Response, TYPES.service("std_srvs/Empty").response.to_layout) == Refusal()
