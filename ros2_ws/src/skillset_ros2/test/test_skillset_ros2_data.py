"""What the data manager gives to conditions."""

from __future__ import annotations

import skillset_interfaces.msg
import skillset_interfaces.srv
from std_msgs.msg import Float64

from alula.model.conditions import holds
from alula.model.expressions import Comparison, DataIs
from alula.runtime.codecs import Codecs
from alula.runtime.middleware import Topic
from alula.runtime.views import Sample
from skillset_ros2.convert import message_class

CODECS = Codecs(skillset_interfaces.msg, skillset_interfaces.srv, message_class)


def test_a_primitive_is_compared_by_what_its_message_carries():
    charged = DataIs("battery", (), Comparison.GT, 20.0, "%")
    codec = CODECS.topic(Topic("/battery", type_name="std_msgs/Float64", wrapped=True, outside=True))
    assert holds(charged, {}, {"battery": codec.decode(Float64(data=0.3)).value})
    assert not holds(charged, {}, {"battery": codec.decode(Float64(data=0.1)).value})


def test_a_message_is_given_as_it_is():
    message = Float64(data=0.3)
    codec = CODECS.topic(Topic("/battery", type_name="std_msgs/Float64", outside=True))
    assert codec.decode(message).value is message
    assert codec.encode("skillset", Sample(message, None)) is message
