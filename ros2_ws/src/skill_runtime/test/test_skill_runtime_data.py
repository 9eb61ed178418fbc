"""What the data manager gives to conditions."""

from __future__ import annotations

from std_msgs.msg import Float64

from skill_model.conditions import holds
from skill_model.expressions import Comparison, DataIs
from skill_model.model import Data
from skill_runtime.plain import carried


def test_a_primitive_is_compared_by_what_its_message_carries():
    charged = DataIs("battery", (), Comparison.GT, 20.0, "%")
    data = Data("battery", "float64", 1.0)
    assert holds(charged, {}, {"battery": carried(data, Float64(data=0.3))})
    assert not holds(charged, {}, {"battery": carried(data, Float64(data=0.1))})


def test_a_message_is_given_as_it_is():
    message = Float64(data=0.3)
    assert carried(Data("battery", "BatteryState", 1.0), message) is message
