"""Calls of services as messages on ``/calls``: a bag then holds the calls to the functional layer, and its own.

Each is a std_msgs/String of JSON: ``{service, request, response, error, begin_s, end_s}``, seconds of mission clock; ``response`` is null
where there was none, and ``error`` says why.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable
from typing import Any

import genpy
import rospy
from std_msgs.msg import String

TOPIC = "/calls"
DEPTH = 100


def plain(value: Any) -> Any:
    """Return a value in the form that ``json`` can write; NaN and infinities become null."""
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, genpy.TVal):
        return value.to_sec()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return [plain(part) for part in value] if isinstance(value, (list, tuple)) else value


def tell_call(service: str, request: Any, response: Any, begin_s: float, error: str = "") -> None:
    """Publish a call that was answered, or failed; any thread."""
    call = {"service": service, "request": plain(request), "response": plain(response), "error": error}
    publisher().publish(String(data=json.dumps({**call, "begin_s": begin_s, "end_s": rospy.get_time()})))


class ToldService:
    """A service whose calls are published on ``/calls``; arguments as of ``rospy.Service``."""

    def __init__(self, name: str, kind: Any, handler: Callable[[Any], Any]) -> None:
        self._handler = handler
        publisher()
        self._service = rospy.Service(name, kind, self._serve)

    def _serve(self, request: Any) -> Any:
        begin_s, name = rospy.get_time(), self._service.resolved_name
        try:
            response = self._handler(request)
        except Exception as error:
            tell_call(name, request, None, begin_s, f"{type(error).__name__}: {error}")
            raise
        tell_call(name, request, response, begin_s)
        return response


@functools.lru_cache(maxsize=None)
def publisher() -> rospy.Publisher:
    """Return the process's own publisher; make it before the first call, as subscribers need a moment to connect."""
    return rospy.Publisher(TOPIC, String, queue_size=DEPTH)
