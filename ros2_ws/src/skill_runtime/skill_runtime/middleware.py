"""What managers and clients need of a middleware: about a dozen verbs. rclpy, rospy and virtual time are adapters of it.

One instance serves one skillset, on one side of its interface; names of topics, services and skills are relative to the skillset.
Values cross as Python has them (``EngineEvent``, mappings of inputs, ``TransitionReply``); adapters make messages of them with the
codecs of ``skill_runtime.codecs``. Callbacks come one at a time, on the middleware's loop: the executor of an rclpy node, a thread
of the rospy adapter, the virtual clock. They must not wait.

Whatever a middleware may lose (a late discovery, a lost answer) is asked for again inside its adapter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from skill_model.execution_state import ExecutionState
from skill_model.model import Data
from skill_model.ros_types import PRIMITIVES
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.records import SkillRecord
from skill_runtime.core.why import Why
from skill_runtime.waiting import Host

Job = Callable[[], object]
OnValue = Callable[[Any], None]
OnSign = Callable[[str, int], None]
"""Gets the life of the managers, and when they gave the sign (mission clock, ns); 0 where the middleware does not tell."""
OnReply = Callable[[Any, int], None]
"""Gets the answer, and how often it was asked for: an answer to the first request may have got lost."""
OnError = Callable[[str], None]
Reply = Callable[[Any], None]
Serve = Callable[[Mapping[str, Any], Reply], None]
"""Answers a request, given its fields by name: calls ``reply(value)`` once, now or later, from any thread."""

CALL_S = 5.0
"""How long a call may take by default."""


@dataclass(frozen=True)
class Topic:
    """A topic of the skillset interface, or of the functional layer.

    Args:
        name: relative to the skillset; of the functional layer, as it is bound.
        keep: so many of the last values are given to a late subscriber.
        type_name: of a data, ``package/Name``; empty: the codec of this name has it, or the graph tells.
        wrapped: the values are primitives, which come as std_msgs/Float64 and the like.
        outside: of the functional layer.
    """

    name: str
    keep: int = 1
    type_name: str = ""
    wrapped: bool = False
    outside: bool = False


EVENTS = Topic("events", keep=1000)
RESOURCE_STATES = Topic("resource_states")
SKILL_STATES = Topic("skill_states")


def data_topic(data: Data, type_name: str = "") -> Topic:
    """Return the topic on which the managers pass on a data; its values are ``Sample``s, as are those of the functional layer."""
    return Topic(f"data/{data.name}", type_name=type_name, wrapped=data.type in PRIMITIVES)


@dataclass(frozen=True)
class ResourceValue:
    """A resource at one moment; ``previous`` is empty before the first transition."""

    state: str
    previous: str
    stamp_ns: int


@dataclass(frozen=True)
class ResourceStates:
    """All resources after a step; ``after`` is the number of the last event that they include, ``life`` names the managers."""

    life: str
    after: int
    stamp_ns: int
    resources: Mapping[str, ResourceValue]


@dataclass(frozen=True)
class Told:
    """An event, and which managers tell it."""

    life: str
    event: EngineEvent


@dataclass(frozen=True)
class SkillStates:
    """All skills at one moment."""

    life: str
    stamp_ns: int
    skills: Mapping[str, SkillRecord]


@dataclass(frozen=True)
class Ending:
    """How a goal ended, as its action tells it."""

    state: ExecutionState
    result: str
    message: str
    outputs: Mapping[str, object]


@dataclass(frozen=True)
class WhyReply:
    """The answer to ``why``: what was found and the resources, or what is wrong with the question."""

    error: str
    why: Why | None = None
    resources: Mapping[str, ResourceValue] = field(default_factory=dict)


class Timer(Protocol):
    """A job that waits for its moment."""

    def cancel(self) -> None:
        """Let the job not happen; without effect when it has."""
        ...


class Publisher(Protocol):
    """A topic's writing end; it may be used from any thread."""

    def publish(self, value: Any) -> None:
        """Send a value to all subscribers, and keep it for those to come."""
        ...

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until the subscribers have what was sent: that of a process that ends would be lost."""
        ...


class Goal(Protocol):
    """A goal at its server; used from any thread."""

    id: str
    inputs: Mapping[str, object]

    def report(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:
        """Send feedback."""
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
        """Tell whether nothing that is sent now would be lost on its way to or from the managers."""
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
        """Send a goal and follow it; ``on_answer`` tells whether it was taken, where the middleware tells it."""
        ...

    def cancel(self, goal_id: str) -> None:
        """Cancel a goal."""
        ...

    def cancel_all(self, on_count: OnValue, on_error: OnError) -> None:
        """Cancel the goals of all clients; ``on_count`` gets how many there were, None where the middleware does not tell."""
        ...

    def ask_ending(self, goal_id: str) -> None:
        """Have a goal's ending told again, if the server knows it."""
        ...

    def release(self, goal_id: str) -> None:
        """Follow a goal no more."""
        ...


class GoalListener(Protocol):
    """What a client hears of its goals by their action."""

    def on_feedback(self, goal_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Take a report of a goal that runs."""
        ...

    def on_ending(self, goal_id: str, ending: Ending | None) -> None:
        """Take the ending of a goal; None: the server does not know the goal."""
        ...


class Middleware(Protocol):
    """The verbs."""

    host: Host
    """How a thread waits for what the loop brings."""

    def now_ns(self) -> int:
        """Return the mission clock."""
        ...

    def at(self, when_ns: int, job: Job) -> Timer:
        """Have a job done on the loop at a moment of the mission clock."""
        ...

    def later(self, delay_s: float, job: Job) -> Timer:
        """Have a job done on the loop after a delay of wall clock (of mission clock where time is virtual)."""
        ...

    def submit(self, job: Job) -> None:
        """Have a job done on the loop, soon; from any thread."""
        ...

    def defer(self, job: Job) -> None:
        """Have a job done that may wait, on a thread of its own (where time is virtual: soon)."""
        ...

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Have a job done on the loop once a condition holds that only the graph brings about; looked at now and then."""
        ...

    def log(self, error: str) -> None:
        """Tell the operator of an error that no caller can be told of."""
        ...

    def new_id(self) -> str:
        """Return an id for a goal, 12 hexadecimal digits."""
        ...

    def advertise(self, topic: Topic) -> Publisher:
        """Open a topic for publishing."""
        ...

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Have ``callback(value)`` called for each value; the returned function tells whether the topic has a publisher."""
        ...

    def serve(self, service: str, handler: Serve) -> None:
        """Serve a service."""
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

        ``once``: what the request asks for must not be done twice.
        """
        ...

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> ActionServer:
        """Serve a skill's action; ``on_cancel`` gets the id of a goal that was taken before."""
        ...

    def action(self, skill: str, listener: GoalListener) -> ActionLink:
        """Connect to a skill's action."""
        ...

    def announce(self, life: str, on_rival: OnError) -> None:
        """Give signs of life from now on, under the name of this life of the managers.

        ``on_rival`` is called with the reason when managers of this skillset are there already.
        """
        ...

    def watch(self, on_sign: OnSign, on_doubt: Job) -> None:
        """Have ``on_sign`` called when managers are heard of, and ``on_doubt()`` when their signs of life stay away."""
        ...

    def close_hooks(self, timeout_s: float) -> bool:
        """Wait (wall clock) for all deferred jobs; tell whether they are done."""
        ...

    def close(self) -> None:
        """Take everything away that was opened here."""
        ...
