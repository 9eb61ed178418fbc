"""Services whose layouts agree: routes of the native data plane. What is promised of calls is the same as in ``services``."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from ros_bridge import native
from ros_bridge.config import ServiceRoute, World
from ros_bridge.native_route import NativeRoute

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import ServiceType
    from ros_bridge.plane import Plane

Refusal = tuple[bool, bool, bytes, bytes]  # there is a flag, there is a text, bytes before the text, bytes behind it


class FastService(NativeRoute):
    """One route. Its figures stay readable after ``close``."""

    def __init__(self, spec: ServiceRoute, service: ServiceType, interface: Any, no: Refusal, node: Node, plane: Plane) -> None:
        """Offer the service; calls cross from here on. ``no`` is the response that refuses. Raises NativeError."""
        super().__init__(plane.native)
        self._spec = spec
        self._plane = plane
        self._in_ros1 = spec.server is World.ROS1
        self._token = plane.token(spec.label)
        with node.handle:
            specification = native.ServiceSpecification(
                ros1_service=spec.ros1_name.encode(),
                ros1_type=service.ros1_name.encode(),
                md5sum=service.md5sum.encode(),
                ros2_service=spec.ros2_name.encode(),
                node=node.handle.pointer,
                type_support=native.type_support_of(interface),
                request_program=native.words_of(service.request.program),
                request_operations=len(service.request.program) // 4,
                response_program=native.words_of(service.response.program),
                response_operations=len(service.response.program) // 4,
                timeout_ns=round(spec.timeout_s * 1e9),
                token=self._token,
                refusal_has_flag=no[0],
                refusal_has_text=no[1],
                refusal_before=no[2],
                refusal_before_bytes=len(no[2]),
                refusal_after=no[3],
                refusal_after_bytes=len(no[3]),
            )
            make = self._native.service_in_ros1_new if self._in_ros1 else self._native.service_in_ros2_new
            self._handle = self._native.require(make(plane.machinery, ctypes.byref(specification)))
        if self._in_ros1:
            plane.call(self._token, self._handle, spec.ros1_name)
        else:
            plane.node.serve(spec.ros1_name)

    def start(self) -> None:
        """Do nothing: a call reaches for the server when it comes."""

    def close(self) -> None:
        """Withdraw the service; calls under way end with an error or a refusal."""
        if self._handle is None:
            return
        if self._in_ros1:
            self._plane.call_no_more(self._token)
        else:
            self._plane.node.unserve(self._spec.ros1_name)
        self._delete()
