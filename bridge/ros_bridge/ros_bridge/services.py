"""Services: a route of the data plane each, whichever world the server is in. Every call ends within its time.

What a caller gets when there is no answer: in ROS 1 a service error with the reason. ROS 2 knows no such error: a response with
a flag ``accepted`` or ``success`` gets it false and the reason in ``reason`` or ``message``; one without gets no response, so the
caller's own timeout ends its wait (and the bridge's log says why).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rclpy.serialization import serialize_message

from ros_bridge import native
from ros_bridge.config import RosVersion, ServiceRoute
from ros_bridge.native import MessageKind
from ros_bridge.native_route import NativeRoute
from ros_bridge.ros1_node import Kind
from ros_bridge.ros2_types import interface_class, type_support_of

if TYPE_CHECKING:
    from ros_bridge.conversion import ServiceType
    from ros_bridge.routes import Context, Route

FLAGS = ("accepted", "success")
TEXTS = ("reason", "message")
LENGTH_BYTES = 4  # before a string in ROS 1


@dataclass(frozen=True)
class Refusal:
    """How a response says no: bytes, as ROS 1 serializes, before and behind the reason. Without a flag it can't, without a text not why."""

    has_flag: bool = False
    has_text: bool = False
    before: bytes = b""
    after: bytes = b""


class NativeService(NativeRoute):
    """A service in one world whose server is in the other; calls cross in the data plane."""

    def __init__(self, spec: ServiceRoute, service: ServiceType, context: Context) -> None:
        """Offer the service; calls cross from here on. Raises BridgeError."""
        super().__init__(context.plane, spec.label)
        self._spec = spec
        self._in_ros1 = spec.server is RosVersion.ROS1
        request, response = service.request, service.response
        same_layout = request.same_layout and response.same_layout
        if not same_layout:
            to_server = request.to_ros1_from_layout if self._in_ros1 else request.to_ros2_layout
            to_client = response.to_ros2_layout if self._in_ros1 else response.to_ros1_from_layout
            self._convert_in_python({MessageKind.REQUEST: to_server, MessageKind.RESPONSE: to_client})
        interface = interface_class(service.ros2_name, "srv")
        no = refusal_around(interface.Response, response.to_layout)
        with context.node.handle:
            specification = native.ServiceSpecification(
                ros1_service=spec.ros1_name.encode(),
                ros1_type=service.ros1_name.encode(),
                md5sum=service.md5sum.encode(),
                ros2_service=spec.ros2_name.encode(),
                node=context.node.handle.pointer,
                type_support=type_support_of(interface),
                request_program=native.words_of(request.program),
                request_operations=len(request.program) // 4,
                response_program=native.words_of(response.program),
                response_operations=len(response.program) // 4,
                timeout_ns=round(spec.timeout_s * 1e9),
                token=self._token,
                converts=not same_layout,
                refusal_has_flag=no.has_flag,
                refusal_has_text=no.has_text,
                refusal_before=no.before,
                refusal_before_bytes=len(no.before),
                refusal_after=no.after,
                refusal_after_bytes=len(no.after),
            )
            make = self._native.service_in_ros1_new if self._in_ros1 else self._native.service_in_ros2_new
            self._handle = self._native.require(make(self._plane.context, ctypes.byref(specification)))
        if self._in_ros1:
            self._plane.call(self._token, self._handle, spec.ros1_name)
        else:
            self._plane.node.register(Kind.SERVICE, spec.ros1_name)

    def start(self) -> None:
        """Do nothing: a call reaches for the server when it comes."""

    def close(self) -> None:
        """Withdraw the service; calls under way end with an error or a refusal."""
        if self._handle is None:
            return
        if self._in_ros1:
            self._plane.call_no_more(self._token)
        else:
            self._plane.node.unregister(Kind.SERVICE, self._spec.ros1_name)
        self._delete()


def refusal(response_class: Any, reason: str) -> Any | None:
    """Return a response that says no, and why, in the fields that the type has for it; None when it has no flag."""
    response = response_class()
    kinds = response_class.get_fields_and_field_types()
    flag = next((name for name in FLAGS if kinds.get(name) == "boolean"), None)
    if flag is None:
        return None
    setattr(response, flag, False)
    text = next((name for name in TEXTS if kinds.get(name) == "string"), None)
    if text is not None:
        setattr(response, text, reason)
    return response


def refusal_around(response_class: Any, to_layout: Callable[[bytes], bytes]) -> Refusal:
    """Return a response that says no as bytes in ROS 1's serialization, taken apart around the reason."""
    empty = refusal(response_class, "")
    if empty is None:
        return Refusal()
    without, with_a_letter = (to_layout(serialize_message(refusal(response_class, reason))) for reason in ("", "x"))
    if without == with_a_letter:
        return Refusal(has_flag=True, before=without)
    length_at = next(place for place, (one, other) in enumerate(zip(without, with_a_letter, strict=False)) if one != other)
    return Refusal(has_flag=True, has_text=True, before=without[:length_at], after=without[length_at + LENGTH_BYTES :])


def make(spec: ServiceRoute, context: Context) -> Route:
    """Make a service's route; raises BridgeError when its type can't cross."""
    return NativeService(spec, context.types.service(spec.type_name, spec.ros2_type, spec.md5sum), context)
