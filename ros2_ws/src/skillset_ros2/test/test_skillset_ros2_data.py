"""What the data manager gives to conditions, and events as messages."""

from __future__ import annotations

import pytest
import skillset_interfaces.msg
import skillset_interfaces.srv
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64

from alula.model.conditions import holds
from alula.model.execution_state import ExecutionState
from alula.model.expressions import Comparison, DataIs
from alula.model.model import ResultKind
from alula.model.unmet import Unmet
from alula.runtime.codecs import Codecs
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from alula.runtime.core.records import ResourceStatus
from alula.runtime.middleware import EVENTS, RESOURCE_STATES, SKILL_STATES, ResourceStates, SkillStates, Topic
from alula.runtime.mission_clock import MissionClock
from alula.runtime.views import Sample
from skillset_ros2.convert import message_class

MISSION_CLOCK = MissionClock(lambda: True, lambda: 0)
CODECS = Codecs(skillset_interfaces.msg, skillset_interfaces.srv, message_class, MISSION_CLOCK)


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


UNMET = Unmet("seen", "eyes == Open and fps > 3.0", "seen: eyes is Shut", {"eyes": "Shut"}, {"fps": None, "level": 0.5})
ENDS = [
    (ExecutionState.RUNNING, None, ()),
    *((ExecutionState.TERMINATED, kind, ()) for kind in ResultKind),
    (ExecutionState.NOT_READY, None, (UNMET,)),
    (ExecutionState.RESOURCE_INVARIANT_VIOLATED, None, (UNMET, UNMET)),
]


@pytest.mark.parametrize(("state", "kind", "unmet"), ENDS)
def test_an_event_says_as_a_message_what_it_was(state, kind, unmet):
    event = ExecutionEvent(3, 1_500_000_000, "go", "1", state, "NAME", "in words", {"speed": 1.0}, {}, "rover", kind, unmet, "an instance")
    codec = CODECS.topic(EVENTS)
    sent = deserialize_message(serialize_message(codec.encode("rover", event)), skillset_interfaces.msg.Event)
    assert codec.decode(sent) == event


def test_whose_a_message_is_and_after_which_event_are_fields_of_it():
    heard = {
        EVENTS: TransitionEvent(2**40, 5, "axes", "FREE", "USED", "extern", "rover", instance_id="an instance"),
        RESOURCE_STATES: ResourceStates("an instance", 2**40, 5, {"axes": ResourceStatus("USED", "FREE", 5)}),
        SKILL_STATES: SkillStates("an instance", 5, {}),
    }
    for topic, value in heard.items():
        codec = CODECS.topic(topic)
        message = codec.encode("rover", value)
        assert (message.instance_id, message.header.frame_id) == ("an instance", "")
        assert topic is SKILL_STATES or message.sequence == 2**40
        assert codec.decode(message) == value
