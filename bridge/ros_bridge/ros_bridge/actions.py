"""Actions: one route for each action, one class for each world that the server can be in.

They connect the goals' state machines (``goals_to_ros1``, ``goals_to_ros2``) with the ends in both worlds. Ends call back on the data
plane's thread for Python and on the executor's; a ``Ticker`` calls back on its own. All of them take the goals' lock, and nothing done
under it waits.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from rclpy.serialization import serialize_message

from ros_bridge import actionlib_wire
from ros_bridge.action_ends_ros1 import ActionlibClientsEnd, ActionlibServerEnd
from ros_bridge.action_ends_ros2 import Ros2ClientsEnd, Ros2ServerEnd, empty_result, result_cdr, stamp_ns
from ros_bridge.action_states import Ros2Status
from ros_bridge.action_types import ActionType, action_type
from ros_bridge.config import ActionRoute, RosVersion
from ros_bridge.goals_to_ros1 import GoalsToRos1
from ros_bridge.goals_to_ros2 import GoalsToRos2
from ros_bridge.ros2_types import interface_class
from ros_bridge.stats import RouteStats

if TYPE_CHECKING:
    from ros_bridge.conversion import TypePair
    from ros_bridge.deferred_service import Header
    from ros_bridge.routes import Context, Route
    from ros_bridge.stats import Figures

logger = logging.getLogger("ros_bridge")

TICK_S = 0.05
IDLE_TICK_S = 0.2
SHUTTING_DOWN = "the bridge is shutting down"
Goals = TypeVar("Goals", GoalsToRos1, GoalsToRos2)


class Ticker:
    """A thread that ticks: every ``TICK_S`` while there is something to watch, else every ``IDLE_TICK_S``."""

    def __init__(self, name: str, tick: Callable[[float], None], busy: Callable[[], bool]) -> None:
        """Prepare; ``tick`` gets the steady clock's time in seconds."""
        self._tick = tick
        self._busy = busy
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread that ticks while goals are open."""
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(TICK_S if self._busy() else IDLE_TICK_S):
            try:
                self._tick(time.monotonic())
            except Exception:  # of a world that is just going away; the next tick must come
                logger.exception("a tick failed")

    def close(self) -> None:
        """Stop, and return when no tick runs any more."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()


class PayloadConverter:
    """Converts goals, feedback and results between the worlds, and counts them."""

    def __init__(self, stats: RouteStats) -> None:
        self._stats = stats

    def to_ros1(self, pair: TypePair, cdr: bytes) -> bytes:
        """Convert CDR to ROS 1's bytes."""
        start_ns = time.perf_counter_ns()
        converted = bytes(pair.to_ros1(cdr))
        self._stats.crossed(time.perf_counter_ns() - start_ns, len(converted))
        return converted

    def to_ros2(self, pair: TypePair, ros1: bytes) -> bytes:
        """Convert ROS 1's bytes to CDR."""
        start_ns = time.perf_counter_ns()
        converted = pair.to_ros2(ros1)
        self._stats.crossed(time.perf_counter_ns() - start_ns, len(converted))
        return converted


class _End(Protocol):
    """An end of an action in one of the worlds."""

    def close(self) -> None:
        """Withdraw all topics and services of this end."""


class _ActionBridge(Generic[Goals]):
    """A route with the server in either world: subclasses open the ends and pass their messages to ``_goals``."""

    GOALS: type[Goals]
    _server: _End
    _clients: _End

    def __init__(self, spec: ActionRoute, action: ActionType, action_class: Any, context: Context) -> None:
        self._spec, self._type, self._class, self._context = spec, action, action_class, context
        self._stats = RouteStats()
        self._payloads = PayloadConverter(self._stats)
        self._goals: Goals = self.GOALS(spec.label, spec.timeout_s)
        self._started = False
        self._ticker = Ticker(spec.target_name, self._goals.tick, lambda: self._goals.busy)

    def start(self) -> None:
        """Connect to the server and offer the action to its clients; messages of the ends wait until both are open."""
        with self._goals.lock:
            self._open()
            self._started = True
        self._ticker.start()

    def _open(self) -> None:
        """Open both ends and connect the goals to them."""
        raise NotImplementedError

    def figures(self) -> Figures:
        """Return how many goals, feedbacks and results have crossed."""
        return self._stats.figures()

    def close(self) -> None:
        """End the open goals for their clients, cancel them at the server, and leave."""
        if not self._started:
            return
        self._ticker.close()
        self._goals.give_up_all(SHUTTING_DOWN, time.monotonic())
        self._clients.close()
        self._server.close()


class ServerInRos1(_ActionBridge[GoalsToRos1]):
    """An action whose actionlib server lives in ROS 1, offered in ROS 2."""

    GOALS = GoalsToRos1
    _server: ActionlibServerEnd
    _clients: Ros2ClientsEnd

    def _open(self) -> None:
        self._server = ActionlibServerEnd(
            self._spec.ros1_name,
            self._type,
            self._context,
            on_status=self._on_status,
            on_feedback=self._on_feedback,
            on_result=self._on_result,
        )
        self._clients = Ros2ClientsEnd(
            self._context.node,
            self._class,
            self._spec.ros2_name,
            on_goal=self._on_goal_request,
            on_cancel=self._on_cancel_request,
            on_result=self._on_result_request,
        )
        self._goals.connect(self._server, self._clients)

    def _on_goal_request(self, request: Any, header: Header) -> None:
        try:
            payload = self._payloads.to_ros1(self._type.goal.pair, bytes(serialize_message(request.goal)))
        except Exception as error:  # noqa: BLE001 - a goal that can't be converted must not leave its client without an answer
            self._stats.failed()
            logger.error("%s: a goal can't be converted: %s: %s", self._spec.label, type(error).__name__, error)
            self._clients.reply_goal(header, accepted=False, stamp_ns=0)
            return
        self._goals.request_goal(header, bytes(request.goal_id.uuid), payload, time.monotonic())

    def _on_cancel_request(self, request: Any, header: Header) -> None:
        info = request.goal_info
        self._goals.request_cancel(header, bytes(info.goal_id.uuid), stamp_ns(info.stamp), time.monotonic())

    def _on_result_request(self, request: Any, header: Header) -> None:
        self._goals.request_result(header, bytes(request.goal_id.uuid))

    def _on_status(self, message: bytes) -> None:
        self._goals.on_status(actionlib_wire.decode_status_array(message), time.monotonic())

    def _on_feedback(self, message: bytes) -> None:
        status, payload = actionlib_wire.decode_outcome(message)
        if self._goals.knows(status):
            self._goals.on_feedback(status, self._payloads.to_ros2(self._type.feedback.pair, payload), time.monotonic())

    def _on_result(self, message: bytes) -> None:
        status, payload = actionlib_wire.decode_outcome(message)
        if self._goals.knows(status):
            self._goals.on_result(status, self._payloads.to_ros2(self._type.result.pair, payload), time.monotonic())


class ServerInRos2(_ActionBridge[GoalsToRos2]):
    """An action whose server lives in ROS 2, offered in ROS 1."""

    GOALS = GoalsToRos2
    _server: Ros2ServerEnd
    _clients: ActionlibClientsEnd

    def _open(self) -> None:
        empty = bytes(self._type.result.pair.to_ros1(bytes(serialize_message(empty_result(self._class, "")))))
        self._server = Ros2ServerEnd(
            self._context.node,
            self._class,
            self._spec.ros2_name,
            on_answer=self._on_answer,
            on_result=self._on_result,
            on_feedback=self._on_feedback,
            on_status=lambda states: self._goals.on_status(states, time.monotonic()),
        )
        self._clients = ActionlibClientsEnd(
            self._spec.ros1_name, self._type, self._context, on_goal=self._on_goal, on_cancel=self._on_cancel, empty_result=empty
        )
        self._goals.connect(self._server, self._clients)

    def _on_goal(self, message: bytes) -> None:
        goal_id, payload = actionlib_wire.decode_goal(message)
        self._goals.on_goal(goal_id, self._payloads.to_ros2(self._type.goal.pair, payload), time.monotonic())

    def _on_cancel(self, message: bytes) -> None:
        self._goals.on_cancel(actionlib_wire.decode_goal_id(message), time.monotonic())

    def _on_answer(self, goal: bytes, response: Any, error: str) -> None:
        accepted = response is not None and response.accepted
        at_ns = stamp_ns(response.stamp) if accepted else 0
        self._goals.on_answer(goal, accepted=accepted, stamp_ns=at_ns, reason=error, now_s=time.monotonic())

    def _on_feedback(self, goal: bytes, cdr: bytes) -> None:
        if self._goals.knows(goal):
            self._goals.on_feedback(goal, self._payloads.to_ros1(self._type.feedback.pair, cdr))

    def _on_result(self, goal: bytes, response: Any, error: str) -> None:
        if response is None:
            self._goals.on_result(goal, Ros2Status.ABORTED, None, error, time.monotonic())
            return
        try:
            payload = self._payloads.to_ros1(self._type.result.pair, result_cdr(response))
        except Exception as problem:  # noqa: BLE001 - a result that can't be converted must not leave the goal open
            self._stats.failed()
            reason = f"its result can't be converted: {type(problem).__name__}: {problem}"
            self._goals.on_result(goal, Ros2Status.ABORTED, None, reason, time.monotonic())
            return
        self._goals.on_result(goal, Ros2Status(response.status), payload, "", time.monotonic())


KINDS: dict[RosVersion, type[ServerInRos1 | ServerInRos2]] = {RosVersion.ROS1: ServerInRos1, RosVersion.ROS2: ServerInRos2}


def make(spec: ActionRoute, context: Context) -> Route:
    """Make an action's route; raises BridgeError when its type can't cross."""
    ros2_type = spec.ros2_type or context.types.rules.to_ros2(spec.type_name)
    action = action_type(context.types, spec.type_name, ros2_type)
    return KINDS[spec.server](spec, action, interface_class(ros2_type, "action"), context)
