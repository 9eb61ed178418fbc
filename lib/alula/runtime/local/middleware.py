"""The middleware of a world in one process: topics, services and actions are jobs of its virtual clock."""

from __future__ import annotations

import copy
import functools
import itertools
import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.model.model import Skill, Skillset
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.local.clock import VirtualClock, WorldError
from alula.runtime.local.values import Types, complete, fit, ros_type
from alula.runtime.middleware import CALL_S, Goal, GoalListener, GoalResult, OnError, OnHeartbeat, OnReply, OnValue, Serve, Topic, thinned
from alula.runtime.timers import Job, Timer
from alula.runtime.waiting import CannotWaitError, Waiter

_LOG = logging.getLogger(__name__)
FOREVER_S = 1e9
Run = Callable[[Callable[[], bool], float], bool]
"""Lets the world run until a condition holds, at most so many seconds of mission clock; tells whether it holds."""


@dataclass
class VirtualTopic:
    """The values that are kept for late subscribers, and the subscribers."""

    values: deque[Any] = field(default_factory=deque)
    subscribers: list[OnValue] = field(default_factory=list)


@dataclass
class Served:
    """What the managers of one skillset serve."""

    middleware: VirtualMiddleware
    instance_id: str = ""
    services: dict[str, Serve] = field(default_factory=dict)
    actions: dict[str, VirtualServer] = field(default_factory=dict)


class Bus:
    """What all middlewares of one world share; whatever crosses takes the latency, and nothing overtakes."""

    def __init__(self, clock: VirtualClock, run: Run, types: Types, latency_s: float) -> None:
        self.clock = clock
        self.types = types
        self.served: dict[str, Served] = {}
        self.watchers: dict[str, list[tuple[OnHeartbeat, Job]]] = {}
        self.ids = itertools.count(1)
        self._run = run
        self._latency_s = latency_s
        self._topics: dict[str, VirtualTopic] = {}

    def send(self, message: Job) -> None:
        """Deliver a message after the bus's latency of mission time."""
        self.clock.after(self._latency_s, message)

    def topic(self, name: str) -> VirtualTopic:
        """Return a topic by its whole name."""
        return self._topics.setdefault(name, VirtualTopic())

    def vanish(self, skillset: str) -> None:
        """Drop what managers served, as it is when their process is killed; their clients begin to doubt."""
        self.served.pop(skillset, None)
        for name, topic in self._topics.items():
            if name.startswith(f"{skillset}/"):
                topic.values.clear()
        for _, on_doubt in self.watchers.get(skillset, ()):
            self.send(on_doubt)

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Let the world run until the event; None: until it comes or nothing can happen any more.

        Raises:
            CannotWaitError: from inside a job of the world, which would wait for itself; or the event can't come any more.
        """
        try:
            if timeout_s is not None:
                return self._run(event.is_set, timeout_s)
            self._run(lambda: event.is_set() or self.clock.idle, FOREVER_S)
        except WorldError as error:
            raise CannotWaitError(str(error)) from error
        if not event.is_set():
            raise CannotWaitError("nothing can happen in this world any more, so what is waited for will not come")
        return True


class VirtualMiddleware:
    """One side of one skillset's interface.

    Args:
        bus: the world's.
        skillset: its name.
        model: of the managers' side.
        on_raise: gets what a job raises; by default it goes on to the caller that lets the world run.
    """

    def __init__(
        self, bus: Bus, skillset: str, *, model: Skillset | None = None, on_raise: Callable[[Exception], None] | None = None
    ) -> None:
        self.bus = bus
        self.waiter: Waiter = bus
        self.skillset = skillset
        self.model = model
        self.alive = True
        self.errors: list[str] = []
        self._on_raise = on_raise

    # --- time --------------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds."""
        return self.bus.clock.now_ns

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment; not when this side has gone by then."""
        return self.bus.clock.at(when_ns, lambda: self.do(job))

    def later(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay."""
        return self.bus.clock.after(delay_s, lambda: self.do(job))

    def submit(self, job: Job) -> None:
        """Run a job at this moment, after all that is due already."""
        self.bus.clock.soon(lambda: self.do(job))

    defer = submit

    def when(self, condition: Callable[[], bool], job: Job) -> None:
        """Do a job at once: nothing has to be discovered here."""
        if condition():
            job()

    def do(self, job: Job) -> None:
        """Do a job of this side, unless it has gone."""
        if not self.alive:
            return
        if self._on_raise is None:
            job()
            return
        try:
            job()
        except Exception as error:  # noqa: BLE001 - the managers report it
            self._on_raise(error)

    def log(self, error: str) -> None:
        """Log an error, and keep it in ``errors`` for tests."""
        self.errors.append(error)
        _LOG.error("%s: %s", self.skillset, error)

    def new_id(self) -> str:
        """Return an id, counted: the same calls make the same run."""
        return f"{next(self.bus.ids):012x}"

    # --- topics ------------------------------------------------------------------------------------------------------

    def advertise(self, topic: Topic) -> VirtualPublisher:
        """Return a latched publisher; late subscribers get the last ``topic.depth`` values."""
        return VirtualPublisher(self.bus, self.bus.topic(f"{self.skillset}/{topic.name}"), topic.depth)

    def subscribe(self, topic: Topic, callback: OnValue) -> Callable[[], bool]:
        """Follow a topic; those of the functional layer have no values here, they come by ``DataManager.receive``."""
        if topic.outside:
            return lambda: True
        found = self.bus.topic(f"{self.skillset}/{topic.name}")
        take = thinned(callback, topic, self.now_ns)
        hear = lambda value: self.do(lambda: take(value))  # noqa: E731
        for value in found.values:
            self.bus.send(functools.partial(hear, value))
        found.subscribers.append(hear)
        return lambda: True

    # --- services ----------------------------------------------------------------------------------------------------

    def serve(self, service: str, handler: Serve) -> None:
        """Have ``handler`` called with each request to this service of the skillset."""
        self._served.services[service] = handler

    def call(
        self,
        service: str,
        request: Mapping[str, object],
        on_reply: OnReply,
        on_error: OnError,
        *,
        timeout_s: float = CALL_S,  # noqa: ARG002 - there is an answer at once, or none
        once: bool = False,  # noqa: ARG002 - no answer gets lost
    ) -> None:
        """Call a service; the reply comes as a message, after the bus's latency, or an error where no managers serve it."""

        def arrive() -> None:
            served = self.bus.served.get(self.skillset)
            if served is None:
                self.bus.send(lambda: self.do(lambda: on_error(f"the managers of {self.skillset} are not there")))
                return
            reply = lambda value: self.bus.send(lambda: self.do(lambda: on_reply(value, 1)))  # noqa: E731
            served.middleware.do(lambda: served.services[service](request, reply))

        self.bus.send(arrive)

    # --- actions -----------------------------------------------------------------------------------------------------

    def serve_action(self, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> VirtualServer:
        """Have goals and cancellations of a skill given to the callbacks."""
        model = (self.model or _no_model(self.skillset)).skill(skill)
        server = self._served.actions[skill] = VirtualServer(self, model, on_goal, on_cancel)
        return server

    def action(self, skill: str, listener: GoalListener) -> VirtualLink:
        """Return a link that sends goals of a skill and gives their news to the listener."""
        return VirtualLink(self, skill, listener)

    # --- heartbeats ----------------------------------------------------------------------------------------------------

    def announce(self, instance_id: str, on_rival: OnError) -> None:  # noqa: ARG002 - a world refuses rivals itself
        """Send a heartbeat of these managers to all watchers."""
        self._served.instance_id = instance_id
        for on_heartbeat, _ in self.bus.watchers.get(self.skillset, ()):
            self.bus.send(functools.partial(on_heartbeat, instance_id, 0))

    def watch(self, on_heartbeat: OnHeartbeat, on_doubt: Job) -> None:
        """Follow the heartbeats of the managers."""
        heard: OnHeartbeat = lambda instance_id, stamp_ns: self.do(lambda: on_heartbeat(instance_id, stamp_ns))  # noqa: E731
        doubted: Job = lambda: self.do(on_doubt)  # noqa: E731
        self.bus.watchers.setdefault(self.skillset, []).append((heard, doubted))
        served = self.bus.served.get(self.skillset)
        if served is not None and served.instance_id:
            instance_id = served.instance_id
            self.bus.send(lambda: heard(instance_id, 0))

    def close_hooks(self, timeout_s: float) -> bool:  # noqa: ARG002 - hooks are jobs of the clock, and can't hang
        """Return True: no hook runs on here."""
        return True

    def close(self) -> None:
        """Send and receive nothing any more."""
        self.alive = False

    @property
    def _served(self) -> Served:
        return self.bus.served.setdefault(self.skillset, Served(self))


class VirtualPublisher:
    """Publishes values of a topic, and keeps the last ``depth`` of them for late subscribers."""

    def __init__(self, bus: Bus, topic: VirtualTopic, depth: int) -> None:
        self._bus = bus
        self._topic = topic
        self._topic.values = deque(maxlen=depth)

    def publish(self, value: Any) -> None:
        """Keep the value and send it to each subscriber."""
        self._topic.values.append(value)
        for subscriber in self._topic.subscribers:
            self._bus.send(functools.partial(subscriber, value))

    def flush(self, timeout_s: float) -> None:
        """Return at once: a message that was sent arrives."""


class VirtualGoal:
    """A goal at its server."""

    def __init__(self, bus: Bus, link: VirtualLink, goal_id: str, inputs: Mapping[str, object]) -> None:
        self.id = goal_id
        self.inputs = inputs
        self.open_at: set[str] = set()
        """The ids of its server's open goals."""
        self._bus = bus
        self._link = link

    def report(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:  # noqa: ARG002 - events tell it
        """Send progress and outputs to the client as feedback."""
        outputs = dict(outputs)
        self._bus.send(lambda: self._link.listener.on_feedback(self.id, progress, outputs))

    def finish(self, event: ExecutionEvent) -> None:
        """Send the terminal event to the client as the goal's result."""
        self.open_at.discard(self.id)
        outputs = self._link.outputs_of(event.outputs)
        ending = GoalResult(event.state, event.result, event.message, outputs)
        self._bus.send(lambda: self._link.listener.on_result(self.id, ending))


class VirtualServer:
    """A skill's action at its manager."""

    def __init__(
        self, middleware: VirtualMiddleware, skill: Skill, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]
    ) -> None:
        self.skill = skill
        self.goals: set[str] = set()
        self._middleware = middleware
        self._on_goal = on_goal
        self._on_cancel = on_cancel

    def inputs_of(self, plain: Mapping[str, object]) -> dict[str, object]:
        """Return inputs as a goal carries them."""
        fitted = fit(self.skill.inputs, plain, f"inputs of {self.skill.name}", self._middleware.bus.types)
        return complete(self.skill.inputs, fitted, self._middleware.bus.types)

    def take(self, goal: VirtualGoal) -> None:
        """Accept a goal and give it to the managers."""
        self.goals.add(goal.id)
        goal.open_at = self.goals
        self._middleware.do(lambda: self._on_goal(goal))

    def cancel(self, goal_id: str) -> None:
        """Ask the managers to interrupt the execution of a goal."""
        self._middleware.do(lambda: self._on_cancel(goal_id))


class VirtualLink:
    """A skill's action at a client."""

    connected = True

    def __init__(self, middleware: VirtualMiddleware, skill: str, listener: GoalListener) -> None:
        self.listener = listener
        self._bus = middleware.bus
        self._middleware = middleware
        self._name = skill
        self._model = self._bus.served[middleware.skillset].actions[skill].skill

    @property
    def input_types(self) -> dict[str, str]:
        """The inputs with their types."""
        return {parameter.name: ros_type(parameter, self._bus.types).interface for parameter in self._model.inputs}

    def fit(self, inputs: Mapping[str, object], place: str) -> dict[str, object]:
        """Return the inputs as hooks get them."""
        return fit(self._model.inputs, inputs, place, self._bus.types)

    def outputs_of(self, plain: Mapping[str, object]) -> dict[str, Any]:
        """Return outputs as a result carries them."""
        return complete(self._model.outputs, copy.deepcopy(dict(plain)), self._bus.types)

    def send(self, goal_id: str, goal: Any, on_answer: Callable[[bool], None]) -> None:
        """Send a goal; ``on_answer(True)`` is called on its arrival, and never where there are no managers."""

        def arrive() -> None:
            server = self._server
            if server is not None:
                server.take(VirtualGoal(self._bus, self, goal_id, goal))
                self._bus.send(lambda: self._middleware.do(lambda: on_answer(True)))

        self._bus.send(arrive)

    def cancel(self, goal_id: str) -> None:
        """Ask for the interruption of one goal."""

        def arrive() -> None:
            server = self._server
            if server is not None:
                server.cancel(goal_id)

        self._bus.send(arrive)

    def cancel_all(self, on_count: OnValue, on_error: OnError) -> None:
        """Ask for the interruption of all goals of the skill; ``on_count`` gets how many there are."""

        def arrive() -> None:
            server = self._server
            if server is None:
                self._bus.send(lambda: on_error(f"the managers of {self._middleware.skillset} are not there"))
                return
            count = len(server.goals)
            for goal_id in sorted(server.goals):
                server.cancel(goal_id)
            self._bus.send(lambda: on_count(count))

        self._bus.send(arrive)

    def request_result(self, goal_id: str) -> None:
        """Ask nothing: nothing gets lost here."""

    def release(self, goal_id: str) -> None:
        """Follow a goal no more."""

    @property
    def _server(self) -> VirtualServer | None:
        served = self._bus.served.get(self._middleware.skillset)
        return None if served is None else served.actions.get(self._name)


def _no_model(skillset: str) -> Skillset:
    raise WorldError(f"the managers' side of {skillset} was made without its model")
