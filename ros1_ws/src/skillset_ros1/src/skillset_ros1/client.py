"""The skillset interface library (paper, section 4.2) over rospy, generic: all it needs it gets from ``describe``.

Each topic of ROS 1 comes over a connection of its own, in no order with the others. So everything that is heard is dealt with by
one thread a client, and whoever is told of an execution's end can see the resources as they are after it.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from skillset_interfaces.msg import Event, ResourceStates
from skillset_interfaces.srv import Describe, DescribeRequest
from std_msgs.msg import Header

from skill_language.json_form import from_json
from skill_language.model import Skillset
from skill_runtime.handle import SkillHandle
from skillset_ros1.calls import call
from skillset_ros1.convert import fields_of, fill
from skillset_ros1.link import SkillLink, is_connected
from skillset_ros1.names import action_types, interfaces_of, place
from skillset_ros1.presence import DOUBT_S, Presence, Verdict
from skillset_ros1.pursuit import Pursuit

TICK_S = 0.02
IDLE_S = 0.25
DESCRIBE_S = 5.0
END_S = 1.0
OnChange = Callable[[dict[str, str]], None]
Job = Callable[[], None]


class SkillsetClient:
    """Starts, watches and interrupts the skills of one skillset, and follows its resources.

    As the client of the ROS 2 world; nothing here waits but ``wait_ready``. Callbacks come on the client's own thread.

    Args:
        name: the skillset.
        namespace: before the skillset's name; by default that of this process's node.
    """

    def __init__(self, name: str, *, namespace: str = "") -> None:
        self.skillset = name
        self._place = place(namespace, name)
        self._lock = threading.Lock()
        self._resources: dict[str, str] = {}
        self._callbacks: list[OnChange] = []
        self._open: dict[str, Pursuit] = {}
        self._links: dict[str, SkillLink] = {}
        self._model: Skillset | None = None
        self._ready = threading.Event()
        self._presence = Presence()
        self._server = ""
        self._asking = False
        self._over = False
        self._last_event = 0
        self._last_transition = 0
        self._states_after = -1
        self._inbox: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"client_{name}", daemon=True)
        self._thread.start()
        self._subscribers = [
            rospy.Subscriber(f"{self._place}/{topic}", kind, self._inbox_of(handler), tcp_nodelay=True)
            for topic, kind, handler in (
                ("resource_states", ResourceStates, self._on_resources),
                ("events", Event, self._on_event),
                ("alive", Header, self._on_alive),
            )
        ]

    # --- what others ask for -----------------------------------------------------------------------------------------

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time."""
        return self._ready.wait(timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._ready.is_set()

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._model is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._model

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        with self._lock:
            return dict(self._resources)

    def on_change(self, callback: OnChange) -> None:
        """Have ``callback(resources)`` called after each step that changed a resource."""
        self._callbacks.append(callback)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._model is None:
            return self._stillborn(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._stillborn(skill)
        pursuit = Pursuit(self.skillset, skill, self._links[skill], self._inbox.put)

        def send() -> None:
            self._open[pursuit.handle.id] = pursuit
            pursuit.handle.add_done_callback(self._forget)
            pursuit.send(goal)

        with self._lock:
            if self._over:
                return self._stillborn(skill)
            self._inbox.put(send)
        return pursuit.handle

    def close(self) -> None:
        """Fail what is open, end the client's thread and its connections."""
        self._inbox.put(None)
        if self._thread is not threading.current_thread():
            self._thread.join(END_S)
        for subscriber in self._subscribers:
            subscriber.unregister()
        for link in self._links.values():
            link.close()

    # --- what is heard, on the client's thread -----------------------------------------------------------------------

    def _on_alive(self, message: Any) -> None:
        self._server = message._connection_header["callerid"]  # noqa: SLF001 - rospy's way to tell who sent it
        if self._heard(message.frame_id):
            self._describe()

    def _on_resources(self, message: Any) -> None:
        life, _, after = message.header.frame_id.partition(" ")
        if not self._heard(life) or int(after) <= self._states_after:
            return
        self._states_after = int(after)
        states = {resource.name: resource.state for resource in message.resources}
        with self._lock:
            self._resources = states
        for callback in self._callbacks:
            callback(dict(states))

    def _on_event(self, event: Any) -> None:
        life = event.header.frame_id
        # Twice comes what was published while the history of earlier events was on its way.
        if not self._heard(life) or event.sequence <= self._last_event:
            return
        self._last_event = event.sequence
        if event.kind == Event.TRANSITION:
            self._last_transition = event.sequence
        elif event.id in self._open:
            self._open[event.id].on_event(event, life, self._last_transition)

    def _on_feedback(self, message: Any) -> None:
        pursuit = self._open.get(message.status.goal_id.id)
        if pursuit is not None:
            pursuit.on_feedback(message.feedback, self._presence.life)

    def _on_result(self, message: Any) -> None:
        pursuit = self._open.get(message.status.goal_id.id)
        if pursuit is not None:
            pursuit.on_result(message.result, self._presence.life)

    def _heard(self, life: str) -> bool:
        """Note a sign of life; forget what was known of earlier managers when these are others."""
        before = self._presence.life
        if not self._presence.heard(life, time.monotonic()):
            return False
        if life != before:
            self._last_event, self._last_transition, self._states_after = 0, 0, -1
            self._ready.clear()
            for pursuit in list(self._open.values()):
                pursuit.outlived(life)
        return True

    # --- presence, on the client's thread ----------------------------------------------------------------------------

    def _describe(self, timeout_s: float = DESCRIBE_S) -> None:
        """Ask for the description, unless it is known or being asked for."""
        if self._asking or (self._model is not None and timeout_s != DOUBT_S):
            return
        self._asking = True
        name = f"{self._place}/describe"
        call(name, Describe, DescribeRequest(), self._inbox_of(self._on_description), self._inbox_of(self._on_silence), timeout_s=timeout_s)

    def _on_description(self, answer: Any) -> None:
        self._asking = False
        self._presence.answered(time.monotonic())
        if self._model is None:
            model = from_json(answer.model_json)
            interfaces = interfaces_of(self.skillset)
            for skill in model.skills:
                types, where = action_types(interfaces, skill.name), f"{self._place}/skill/{skill.name}"
                self._links[skill.name] = SkillLink(where, types, self._inbox_of(self._on_feedback), self._inbox_of(self._on_result))
            self._model = model

    def _on_silence(self, reason: str) -> None:
        self._asking = False
        rospy.logdebug("%s", reason)

    def _look(self) -> None:
        """Take the next step towards being ready, or to certainty about a loss; end what can be ended."""
        verdict = self._presence.check(time.monotonic(), connected=is_connected(self._subscribers[-1]))
        if verdict is Verdict.ASK:
            self._describe(DOUBT_S)
        elif verdict is Verdict.GONE:
            self._ready.clear()
            self._abandon(f"the managers of {self.skillset} have gone: they ended, or gave no sign of life")
        if self._presence.alive and not self.ready and self._can_be_called():
            self._ready.set()
        for pursuit in list(self._open.values()):
            pursuit.settle(self._states_after)

    def _can_be_called(self) -> bool:
        heard = self._model is not None and self._states_after >= 0 and all(is_connected(s, self._server) for s in self._subscribers)
        return heard and all(link.connected(self._server) for link in self._links.values())

    def _abandon(self, reason: str) -> None:
        for pursuit in list(self._open.values()):
            pursuit.abandon(reason)

    # --- parts -------------------------------------------------------------------------------------------------------

    def _forget(self, handle: SkillHandle) -> None:
        self._open.pop(handle.id, None)

    def _inbox_of(self, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that has ``handler`` called on the client's thread."""
        return lambda message: self._inbox.put(lambda: handler(message))

    def _run(self) -> None:
        while True:
            restless = not self.ready or any(pursuit.restless for pursuit in self._open.values())
            try:
                job = self._inbox.get(timeout=TICK_S if restless else IDLE_S)
            except queue.Empty:
                job = self._nothing
            if job is None or rospy.is_shutdown():
                break
            self._do(job)
            self._do(self._look)
        self._ready.clear()
        with self._lock:
            self._over = True
        while not self._inbox.empty():
            self._do(self._inbox.get() or self._nothing)
        self._abandon(f"the client of {self.skillset} was closed")

    def _do(self, job: Job) -> None:
        try:
            job()
        except Exception as error:  # noqa: BLE001 - a callback must not end the client
            rospy.logerr("client of %s: %s: %s", self.skillset, type(error).__name__, error)

    @staticmethod
    def _nothing() -> None:
        """Have come to look at the time."""

    def _goal(self, skill: str, inputs: dict[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        if skill not in self._links:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(self._links)}")
        goal = self._links[skill].types.goal()
        where = f"inputs of {self.skillset}.{skill}"
        fill(goal, inputs, where)
        missing = [name for name in fields_of(goal) if name not in inputs]
        if missing:
            raise ValueError(f"{where}: {', '.join(missing)} missing")
        return goal

    def _stillborn(self, skill: str) -> SkillHandle:
        handle = SkillHandle(skill, "")
        handle.fail(f"the managers of {self.skillset} are not there")
        return handle
