"""The middleware port: the verbs that managers and clients need. rclpy, rospy and virtual time are its adapters.

One instance serves one skillset, on one side of its interface; names of topics, services and skills are relative to the skillset.
Values cross as Python has them (``EngineEvent``, mappings of inputs, ``TransitionReply``); adapters make messages of them with the
codecs of ``alula.runtime.codecs``. Callbacks come one at a time, on the middleware's loop: the executor of an rclpy node, a thread
of the rospy adapter, the virtual clock. They must not wait.

An adapter asks again for what its middleware may lose (the answer of a service that was discovered late).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from alula.model.execution_state import ExecutionState
from alula.model.model import Data
from alula.model.ros_types import PRIMITIVES
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.core.records import ResourceStatus, SkillRecord
from alula.runtime.core.why import Why
from alula.runtime.timers import Job, Timer
from alula.runtime.waiting import Waiter

OnValue = Callable[[Any], None]
OnHeartbeat = Callable[[str, int], None]
"""Gets the instance id of the managers, and the stamp of the heartbeat (mission clock, ns); 0 where the middleware has none."""
OnReply = Callable[[Any, int], None]
"""Gets the response, and how many requests were sent for it: the response to an earlier one may have got lost."""
OnError = Callable[[str], None]
Reply = Callable[[Any], None]
Serve = Callable[[Mapping[str, Any], Reply], None]
"""Answers a request, given its fields by name: calls ``reply(value)`` once, now or later, from any thread."""

CALL_S = 5.0
"""Default time limit of a call."""
ALIVE_PERIOD_S = 0.5
"""Managers send a heartbeat so often (wall clock), whatever their hooks do: who is in another world has nothing else to tell by."""


@dataclass(frozen=True)
class Topic:
    """A topic of the skillset interface, or of the functional layer.

    Args:
        name: relative to the skillset; of the functional layer, as it is bound.
        depth: so many of the last values are given to a late subscriber.
        type_name: of a data, ``package/Name``; empty: the codec of this name has it, or the graph tells.
        wrapped: the values are primitives, which come as std_msgs/Float64 and the like.
        outside: a topic of the functional layer, not of the skillset interface.
        every_s: for subscribers; what comes within so many seconds of mission clock after a value that was taken is left out.
    """

    name: str
    depth: int = 1
    type_name: str = ""
    wrapped: bool = False
    outside: bool = False
    every_s: float = 0.0


EVENTS = Topic("events", depth=1000)
RESOURCE_STATES = Topic("resource_states")
REPORTED = Topic("reported", depth=10)
"""What reporters of the functional layer say, twice a second: their heartbeat. Values are ``ResourceStates``."""
SKILL_STATES = Topic("skill_states")


def data_topic(data: Data, type_name: str = "", every_s: float = 0.0) -> Topic:
    """Return the topic on which the managers pass on a data; its values are ``Sample``s, as are those of the functional layer."""
    return Topic(f"data/{data.name}", type_name=type_name, wrapped=data.type in PRIMITIVES, every_s=every_s)


def thinned(callback: OnValue, topic: Topic, now_ns: Callable[[], int]) -> OnValue:
    """Return what passes on to a callback the values that a topic's ``every_s`` leaves."""
    every_ns, taken_ns = round(topic.every_s * 1e9), [-(1 << 63)]

    def take(value: Any) -> None:
        now = now_ns()
        if now - taken_ns[0] >= every_ns:
            taken_ns[0] = now
            callback(value)

    return take if every_ns else callback


@dataclass(frozen=True)
class ResourceStates:
    """All resources after a step; ``sequence``: of the last event that they include; ``instance_id``: as in the events."""

    instance_id: str
    sequence: int
    stamp_ns: int
    resources: Mapping[str, ResourceStatus]


@dataclass(frozen=True)
class SkillStates:
    """All skills at one moment."""

    instance_id: str
    stamp_ns: int
    skills: Mapping[str, SkillRecord]


@dataclass(frozen=True)
class GoalResult:
    """The result of a goal, as its action carries it."""

    state: ExecutionState
    result: str
    message: str
    outputs: Mapping[str, object]


@dataclass(frozen=True)
class WhyReply:
    """The response of ``why``: the answer and the resources, or the ``error`` of the request."""

    error: str
    why: Why | None = None
    resources: Mapping[str, ResourceStatus] = field(default_factory=dict)


class Publisher(Protocol):
    """A topic's writing end; it may be used from any thread."""

    def publish(self, value: Any) -> None:
        """Send a value to all subscribers, and keep it for later ones."""
        ...

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until the subscribers have received everything: what a process has sent just before its end may be lost."""
        ...


class Goal(Protocol):
    """A goal at its server; used from any thread."""

    id: str
    inputs: Mapping[str, object]

    def report(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:
        """Send progress (0 to 1), the state and the outputs so far to the goal's client."""
        ...

    def finish(self, event: ExecutionEvent) -> None:
        """Set the goal's terminal state and send its result."""
        ...


class ActionServer(Protocol):
    """A skill's action as its manager serves it."""

    def inputs_of(self, plain: Mapping[str, object]) -> dict[str, object]:
        """Return inputs as a goal carries them, from plain values; raise ValueError where they don't fit."""
        ...


class ActionLink(Protocol):
    """A skill's action as a client uses it; from any thread."""

    @property
    def connected(self) -> bool:
        """Return whether both directions are connected, so that no message is lost."""
        ...

    @property
    def input_types(self) -> dict[str, str]:
        """The inputs with their types, as ``{"height": "float64", "target": "geometry_msgs/Point"}``."""
        ...

    def fit(self, inputs: Mapping[str, object], place: str) -> Any:
        """Return a goal to be sent; raise ValueError, which names ``place``, where the inputs don't fit."""
        ...

    def outputs_of(self, plain: Mapping[str, object]) -> dict[str, Any]:
        """Return outputs as a result carries them, from plain values: those that are missing as an empty message has them."""
        ...

    def send(self, goal_id: str, goal: Any, on_answer: Callable[[bool], None]) -> None:
        """Send a goal and follow it; ``on_answer`` gets whether it was accepted, where the middleware has such an answer."""
        ...

    def cancel(self, goal_id: str) -> None:
        """Ask for the interruption of a goal; its result tells how it ended."""
        ...

    def cancel_all(self, on_count: OnValue, on_error: OnError) -> None:
        """Cancel the goals of all clients; ``on_count`` gets their number, None where the middleware does not know it."""
        ...

    def request_result(self, goal_id: str) -> None:
        """Ask the server for the result of a goal; the listener gets it."""
        ...

    def release(self, goal_id: str) -> None:
        """Forget a goal: its listener hears nothing of it any more."""
        ...


class GoalListener(Protocol):
    """Receives what the actions of a client send about its goals."""

    def on_feedback(self, goal_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Take the feedback of a goal."""
        ...

    def on_result(self, goal_id: str, ending: GoalResult | None) -> None:
        """Take the result of a goal; None: the server does not know the goal."""
        ...


class Middleware(Protocol):
    """The verbs; one instance serves one skillset, on one side of its interface."""

    waiter: Waiter
    """Blocks a thread until an event of the loop."""

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds."""
        ...

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job on the loop at a moment of the mission clock."""
        ...

    def later(self, delay_s: float, job: Job) -> Timer:
        """Run a job on the loop after a delay of wall clock (of mission clock where time is virtual)."""
        ...

    def submit(self, job: Job) -> None:
        """Run a job on the loop, soon; from any thread."""
        ...

    def defer(self, job: Job) -> None:
        """Run a job that may wait, on a thread of its own (where time is virtual: soon)."""
        ...

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Run a job on the loop once a condition holds ; it is polled, for conditions of the graph that cause no event."""
        ...

    def log(self, error: str) -> None:
        """Log an error that no caller gets."""
        ...

    def new_id(self) -> str:
        """Return a new id, 12 hexadecimal digits: of a goal, of managers."""
        ...

    def advertise(self, topic: Topic) -> Publisher:
        """Open a topic for publishing."""
        ...

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Call ``callback(value)`` for each value; the returned function tells whether the topic has a publisher."""
        ...

    def serve(self, service: str, handler: Serve) -> None:
        """Serve a service of the skillset; its name is relative to the skillset's namespace."""
        ...

    def call(
        self,
        service: str,
        request: Mapping[str, object],
        on_reply: OnReply,
        on_error: OnError,
        *,
        timeout_s: float = CALL_S,
        once: bool = False,
    ) -> None:
        """Call a service as soon as it is there; either ``on_reply`` or ``on_error`` is called, within the time.

        ``once``: send the request once only, because its effect must not happen twice.
        """
        ...

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> ActionServer:
        """Serve a skill's action; ``on_cancel`` gets the id of a goal that ``on_goal`` has got."""
        ...

    def action(self, skill: str, listener: GoalListener) -> ActionLink:
        """Connect to a skill's action."""
        ...

    def announce(self, instance_id: str, on_rival: OnError) -> None:
        """Send heartbeats from now on; ``instance_id`` is new at each start of the managers.

        ``on_rival`` is called with the reason when other managers of this skillset run already.
        """
        ...

    def watch(self, on_heartbeat: OnHeartbeat, on_doubt: Job) -> None:
        """Call ``on_heartbeat`` at each heartbeat of the managers, and ``on_doubt()`` when the heartbeats stay away."""
        ...

    def close_hooks(self, timeout_s: float) -> bool:
        """Wait (wall clock) for all deferred jobs; tell whether they are done."""
        ...

    def close(self) -> None:
        """Close everything that was opened here."""
        ...
