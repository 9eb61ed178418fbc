"""What the data manager gives to conditions."""

from __future__ import annotations

from std_msgs.msg import Float64

from skill_model.conditions import holds
from skill_model.expressions import Comparison, DataIs
from skill_runtime.codecs import codec_of
from skill_runtime.middleware import Topic
from skill_runtime.views import Sample


def test_a_primitive_is_compared_by_what_its_message_carries():
    charged = DataIs("battery", (), Comparison.GT, 20.0, "%")
    codec = codec_of(Topic("/battery", type_name="std_msgs/Float64", wrapped=True, outside=True))
    assert holds(charged, {}, {"battery": codec.decode(Float64(data=0.3)).value})
    assert not holds(charged, {}, {"battery": codec.decode(Float64(data=0.1)).value})


def test_a_message_is_given_as_it_is():
    message = Float64(data=0.3)
    codec = codec_of(Topic("/battery", type_name="std_msgs/Float64", outside=True))
    assert codec.decode(message).value is message
    assert codec.encode("skillset", Sample(message, None)) is message
