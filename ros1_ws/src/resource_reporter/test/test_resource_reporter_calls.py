"""Calls of services as messages: what is told of requests and responses."""

from __future__ import annotations

import json
import math

import genpy
from geometry_msgs.msg import Point
from skillset_interfaces.srv import TransitionRequest
from std_srvs.srv import SetBoolRequest

from resource_reporter.calls import plain


def test_requests_become_plain_values_that_json_can_write():
    assert plain(TransitionRequest("zed_status", "BROKEN", "it is dark")) == {
        "resource": "zed_status",
        "to": "BROKEN",
        "reason": "it is dark",
    }
    assert plain(SetBoolRequest(True)) == {"data": True}
    assert plain(Point(1.0, math.nan, -math.inf)) == {"x": 1.0, "y": None, "z": None}
    assert plain([genpy.Time(3, 500_000_000), "text", 7]) == [3.5, "text", 7]
    assert json.loads(json.dumps(plain([Point(), None]), allow_nan=False)) == [{"x": 0.0, "y": 0.0, "z": 0.0}, None]
