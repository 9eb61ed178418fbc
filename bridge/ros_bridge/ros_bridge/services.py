"""Services through rospy and rclpy: one class for each side that the server can be on. Every call ends within its time.

It is for types whose layouts differ, and where the native data plane was not built; all others are ``fast_services``.

What a caller gets when there is no answer: in ROS 1 a service error with the reason. ROS 2 knows no such error: a response with
a flag ``accepted`` or ``success`` gets it false and the reason in ``reason`` or ``message``; one without gets no response, so the
caller's own timeout ends its wait (and the bridge's log says why).
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from rclpy.serialization import deserialize_message, serialize_message

from ros_bridge import raw
from ros_bridge.config import ServiceRoute, World
from ros_bridge.errors import CallError, CallTimeoutError
from ros_bridge.fast_services import FastService
from ros_bridge.later import Header, LaterService
from ros_bridge.ros1_call import POLL_S, Deadline, Ros1Service
from ros_bridge.stats import RouteStats
from ros_bridge.topics import interface_class

import rospy  # isort: skip - after ros_bridge.raw, which fetches it
import rosgraph  # isort: skip

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import ServiceType
    from ros_bridge.raw import RawMessage
    from ros_bridge.routes import Context, Route
    from ros_bridge.stats import Figures

logger = logging.getLogger("ros_bridge")

CONCURRENT_CALLS = 16  # of one service towards ROS 1, each in a thread
WAITING_CALLS = 32  # of one service; more are refused at once
FLAGS = ("accepted", "success")
TEXTS = ("reason", "message")
LENGTH_BYTES = 4  # before a string in ROS 1


class Ros2Server:
    """A service whose server lives in ROS 2, offered in ROS 1. rospy gives each caller a thread; it waits here for the answer."""

    def __init__(self, route: ServiceRoute, service: ServiceType, node: Node) -> None:
        """Offer the service; calls are answered as soon as the node is spun."""
        self._route = route
        self._node = node
        self._type = service
        self._stats = RouteStats()
        self._ros2_class = interface_class(service.ros2_name, "srv")
        self._closed = threading.Event()
        self._client = node.create_client(self._ros2_class, route.ros2_name)
        self._raw_service = raw.service_class(service)
        self._service = rospy.Service(route.ros1_name, self._raw_service, self._handle)

    def _handle(self, request: RawMessage) -> RawMessage:
        start_ns = time.perf_counter_ns()
        try:
            response = self._call(bytes(request.data))
        except CallError as error:
            self._stats.failed()
            raise rospy.ServiceException(f"{self._route.ros1_name} by the bridge: {error}") from error
        self._stats.crossed(time.perf_counter_ns() - start_ns)
        answer: RawMessage = self._raw_service._response_class(response)  # noqa: SLF001 - rospy's attribute
        return answer

    def _call(self, ros1_request: bytes) -> memoryview:
        """Call the server in ROS 2 with a serialized request; return the serialized response."""
        deadline = Deadline.after(self._route.timeout_s)
        request = deserialize_message(self._type.request.to_ros2(ros1_request), self._ros2_class.Request)
        self._wait_for_server(deadline)
        answered = threading.Event()
        future = self._client.call_async(request)
        future._set_executor = lambda _: None  # noqa: SLF001 - else its callback waits for another round of the executor
        future.add_done_callback(lambda _: answered.set())
        try:
            while not answered.wait(min(POLL_S, deadline.remaining_s("the server in ROS 2 has not answered"))):
                self._require_alive()
        finally:
            self._client.remove_pending_request(future)
        return self._type.response.to_ros1(serialize_message(future.result()))

    def _wait_for_server(self, deadline: Deadline) -> None:
        while not self._client.service_is_ready():
            if self._closed.wait(min(POLL_S, deadline.remaining_s(f"no server for {self._route.ros2_name} in ROS 2"))):
                raise CallError("the bridge is shutting down")

    def _require_alive(self) -> None:
        if self._closed.is_set():
            raise CallError("the bridge is shutting down")
        if not self._client.service_is_ready():
            raise CallError("the server in ROS 2 ended in the call")

    def start(self) -> None:
        """Do nothing: a call reaches for the server when it comes."""

    def figures(self) -> Figures:
        """Return what was called."""
        return self._stats.figures()

    def close(self) -> None:
        """Withdraw the service; callers get an error."""
        self._closed.set()
        self._service.shutdown()
        self._node.destroy_client(self._client)


class Ros1Server:
    """A service whose server lives in ROS 1, offered in ROS 2. The executor only takes the request; threads wait for the answer."""

    def __init__(self, route: ServiceRoute, service: ServiceType, node: Node) -> None:
        """Offer the service; calls are taken as soon as the node is spun."""
        self._route = route
        self._node = node
        self._type = service
        self._stats = RouteStats()
        self._ros2_class = interface_class(service.ros2_name, "srv")
        self._link = Ros1Service(route.ros1_name, service.md5sum, master_uri=rosgraph.get_master_uri(), caller_id=rospy.get_caller_id())
        self._threads = ThreadPoolExecutor(CONCURRENT_CALLS, thread_name_prefix=route.ros2_name)
        self._vacancies = threading.Semaphore(CONCURRENT_CALLS + WAITING_CALLS)
        self._service = LaterService(node, self._ros2_class, route.ros2_name, self._take)

    def _take(self, request: Any, header: Header) -> None:
        deadline = Deadline.after(self._route.timeout_s)
        if self._vacancies.acquire(blocking=False):
            self._threads.submit(self._answer, request, header, deadline)
        else:
            self._refuse(header, CallError(f"the bridge has {CONCURRENT_CALLS + WAITING_CALLS} calls of this service waiting"))

    def _answer(self, request: Any, header: Header, deadline: Deadline) -> None:
        start_ns = time.perf_counter_ns()
        try:
            ros1_request = self._type.request.to_ros1(serialize_message(request))
            ros1_response = self._link.call(ros1_request, deadline)
            response = deserialize_message(self._type.response.to_ros2(ros1_response), self._ros2_class.Response)
            self._service.reply(response, header)
            self._stats.crossed(time.perf_counter_ns() - start_ns)
        except CallError as error:
            self._refuse(header, error)
        except Exception as error:  # noqa: BLE001 - an answer that can't be read must not leave the caller without one
            self._refuse(header, CallError(f"{type(error).__name__}: {error}"))
        finally:
            self._vacancies.release()

    def _refuse(self, header: Header, error: CallError) -> None:
        self._stats.failed()
        reason = f"{self._route.ros2_name} by the bridge: {error}"
        kind = "timed out" if isinstance(error, CallTimeoutError) else "failed"
        logger.warning("call %s: %s", kind, reason)
        response = refusal(self._ros2_class.Response, reason)
        if response is not None:
            self._service.reply(response, header)

    def start(self) -> None:
        """Do nothing: a call reaches for the server when it comes."""

    def figures(self) -> Figures:
        """Return what was called."""
        return self._stats.figures()

    def close(self) -> None:
        """End the calls under way; their callers get refusals."""
        self._link.close()
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._service.close()


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


def refusal_around(response_class: Any, convert: Callable[[bytes], memoryview]) -> tuple[bool, bool, bytes, bytes]:
    """Return a response that says no as bytes of ROS 1: whether it can, whether it has a reason, and what is before and after that."""
    empty = refusal(response_class, "")
    if empty is None:
        return False, False, b"", b""
    without, with_a_letter = (bytes(convert(serialize_message(refusal(response_class, reason)))) for reason in ("", "x"))
    if without == with_a_letter:
        return True, False, without, b""
    length_at = next(place for place, (one, other) in enumerate(zip(without, with_a_letter, strict=False)) if one != other)
    return True, True, without[:length_at], without[length_at + LENGTH_BYTES :]


KINDS: dict[World, type[Ros2Server | Ros1Server]] = {World.ROS1: Ros1Server, World.ROS2: Ros2Server}


def make(spec: ServiceRoute, context: Context) -> Route:
    """Make a service's route, by the native data plane where the layouts agree; raises BridgeError when its type can't cross."""
    service = context.types.service(spec.type_name, spec.ros2_type)
    if context.plane is not None and service.request.same_layout and service.response.same_layout:
        interface = interface_class(service.ros2_name, "srv")
        no = refusal_around(interface.Response, service.response.to_ros1)
        return FastService(spec, service, interface, no, context.node, context.plane)
    return KINDS[spec.server](spec, service, context.node)
