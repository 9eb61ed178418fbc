"""The skillset interface library (paper, section 4.2), generic: all it needs it gets from ``describe`` and the generated actions."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakSet

from action_msgs.srv import CancelGoal
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from skillset_interfaces.msg import Event, SkillStates
from skillset_interfaces.srv import GetData, SetPaused, Transition
from skillset_interfaces.srv import Why as WhyService

from skill_language.model import Skillset
from skill_runtime.core.execution import ExecutionState
from skill_runtime.core.why import Why
from skill_runtime.handle import Ended, SkillHandle
from skill_runtime.messages import why_of
from skill_runtime.plain import to_plain
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.feed import TopicFeed
from skill_runtime.ros2.names import EVENTS, LATCHED, LIVELINESS_LEASE_S
from skill_runtime.ros2.presence import Presence
from skill_runtime.ros2.pursuit import Pursuit, outputs_of
from skill_runtime.ros2.questions import HOOK_PATIENCE_S, Questions
from skill_runtime.ros2.resting_action import RestingGroup
from skill_runtime.ros2.spinning import SpunHost
from skill_runtime.views import DataReading, Forget, SkillsetView, TransitionAnswer
from skill_runtime.waiting import Pending

__all__ = ["SkillHandle", "SkillsetClient"]

TICK_S = 0.05
OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[Any], None]
OnSkills = Callable[[dict[str, Any]], None]
HOOK_AGAIN_S = 5.0
SERVICES = {"why": WhyService, "pause": SetPaused, "transition": Transition, "get_data": GetData}


class SkillsetClient:
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    Nothing here waits but ``wait_ready``. Callbacks come on the thread that spins ``node``, in a callback group of the client's
    own: with an executor of several threads, other callbacks may wait for a skill.

    Args:
        node: whose executor serves the client.
        name: the skillset.
        namespace: of the robot, as ``/robot1``; by default the node's.
    """

    def __init__(self, node: Node, name: str, *, namespace: str = "") -> None:
        self.skillset = name
        self.root = f"{namespace.rstrip('/')}/{name}" if namespace else name
        self._node = node
        self._host = SpunHost(node)
        self._lock = threading.Lock()
        self._resources: dict[str, str] = {}
        self._on_changes: list[OnChange] = []
        self._on_events: list[OnEvent] = []
        self._open: dict[str, Pursuit] = {}
        self._feeds: dict[str, TopicFeed] = {}
        self._skills: dict[str, Any] = {}
        self._on_skills_told: list[OnSkills] = []
        self._moments: WeakSet[Pending[Any]] = WeakSet()
        group = RestingGroup()
        self._group = group
        self._questions = Questions(node, group, self._host, self._wake)
        self._presence = Presence(
            node,
            name,
            on_resources=self._on_resources,
            on_doubt=self._wake,
            on_answer=self._ask_again,
            on_gone=self._on_gone,
            root=self.root,
            group=group,
        )
        node.create_subscription(Event, f"{self.root}/events", self._on_event, EVENTS, callback_group=group)
        node.create_subscription(SkillStates, f"{self.root}/skill_states", self._on_skill_states, LATCHED, callback_group=group)
        for service, kind in SERVICES.items():
            self._questions.prepare(kind, f"{self.root}/{service}")
        # Runs only while there is something to wait for.
        self._timer = node.create_timer(TICK_S, self._tick, callback_group=group, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time.

        Spins the node when it has no executor; otherwise another thread must be spinning it.

        Raises:
            CannotWaitError: this thread spins the node itself.
        """
        return self.ready or self._host.wait(self._presence.ready, timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._presence.ready.is_set()

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._presence.model is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._presence.model

    @property
    def view(self) -> SkillsetView:
        """Return the skillset as attributes; raise RuntimeError before ``wait_ready``."""
        return SkillsetView(self)

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        with self._lock:
            return dict(self._resources)

    def on_change(self, callback: OnChange) -> Forget:
        """Have ``callback(resources)`` called after each step that changed a resource; the return value ends that."""
        return self._subscribe(self._on_changes, callback)

    def on_event(self, callback: OnEvent) -> Forget:
        """Have ``callback(event)`` called for each skillset_interfaces/Event from now on; the return value ends that."""
        return self._subscribe(self._on_events, callback)

    def _subscribe(self, callbacks: list[Callable[[Any], None]], callback: Callable[[Any], None]) -> Forget:
        with self._lock:
            callbacks.append(callback)

        def forget() -> None:
            with self._lock:
                if callback in callbacks:
                    callbacks.remove(callback)

        return forget

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._presence.model is None:
            return self._stillborn(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._stillborn(skill)
        actions, clients = self._presence.actions, self._presence.clients
        pursuit = Pursuit(self.skillset, skill, actions[skill], clients[skill], pause=self.set_paused, host=self._host)
        with self._lock:
            self._open[pursuit.handle.id] = pursuit
        pursuit.handle.add_done_callback(self._forget)
        pursuit.send(goal)
        self._timer.reset()
        return pursuit.handle

    def last(self, skill: str) -> Ended[dict[str, Any], str] | None:
        """Return how the skill's last execution ended, whoever asked for it and whenever; None when none has.

        Raises:
            ValueError: there is no such skill.
        """
        self._check_skill(skill)
        known = self._skills.get(skill)
        if known is None or not known.last:
            return None
        last = known.last[0]
        outputs = outputs_of(self._presence.actions[skill], json.loads(last.outputs_json), skill)
        return Ended(skill, last.id, ExecutionState(last.state), last.result, last.message, outputs)

    def on_skills(self, callback: OnSkills) -> Forget:
        """Have ``callback(skills)`` called after changes, with a skillset_interfaces/SkillState by skill; the return value ends that."""
        return self._subscribe(self._on_skills_told, callback)

    @property
    def skills(self) -> dict[str, Any]:
        """Return the skillset_interfaces/SkillState of every skill: what runs, and what ended last; empty until they were heard."""
        return dict(self._skills)

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask the managers whether the skill could start now, and if not, why not; with inputs its ``validate`` is asked, too.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        inputs_json = "" if inputs is None else json.dumps(to_plain(self._goal(skill, inputs)))
        self._check_skill(skill)
        request = WhyService.Request(skill=skill, inputs_json=inputs_json)
        answer = lambda response, _: why_of(skill, response)  # noqa: E731
        return self._questions.ask(WhyService, f"{self.root}/why", request, answer, patience_s=HOOK_PATIENCE_S, again_s=HOOK_AGAIN_S)

    def set_paused(self, execution_id: str, paused: bool) -> Pending[str]:  # noqa: FBT001 - as the service has it
        """Ask for a pause or a resumption; the answer is "", or why not."""
        request = SetPaused.Request(id=execution_id, paused=paused)
        answer = lambda response, _: "" if response.accepted else response.reason  # noqa: E731
        # Asked once only: a hook that takes its time would be asked again.
        return self._questions.ask(SetPaused, f"{self.root}/pause", request, answer, patience_s=HOOK_PATIENCE_S, again_s=math.inf)

    def transition(self, resource: str, to: str) -> Pending[TransitionAnswer]:
        """Ask for an extern transition, as the functional layer does."""

        def answer(response: Any, tries: int) -> TransitionAnswer:
            # An answer that got lost may have been that the transition was taken.
            accepted = response.accepted or (tries > 1 and response.state == to)
            return TransitionAnswer(accepted, "" if accepted else response.reason, response.state)

        request = Transition.Request(resource=resource, to=to)
        return self._questions.ask(Transition, f"{self.root}/transition", request, answer)

    def data_feed(self, name: str) -> TopicFeed:
        """Return the values of a data; it is subscribed to when it is first asked for.

        Raises:
            ValueError: there is no such data.
        """
        known = {data.name: data for data in self.model.data}
        if name not in known:
            raise ValueError(f"skillset {self.skillset} has no data {name!r}; it has {', '.join(known) or 'none'}")
        with self._lock:
            feed = self._feeds.get(name)
            if feed is None:
                feed = self._feeds[name] = TopicFeed(self._node, self.root, known[name], self._group, self._questions)
        if feed.restless:
            feed.tick()
            self._wake()
        return feed

    def read_data(self, name: str) -> Pending[DataReading]:
        """Ask the managers for a data's value as JSON: also of a type that is not known here."""

        def answer(response: Any, tries: int) -> DataReading:  # noqa: ARG001
            return DataReading(response.known, response.received, response.stale, response.stamp_ns, response.value_json)

        return self._questions.ask(GetData, f"{self.root}/get_data", GetData.Request(name=name), answer)

    def input_types(self, skill: str) -> dict[str, str]:
        """Return a skill's inputs with their ROS types, as ``{"height": "double"}``; raise ValueError."""
        self._check_skill(skill)
        return fields_of(self._presence.actions[skill].Goal)

    def interrupt_all(self, skill: str) -> Pending[int]:
        """Ask for the end of all executions of a skill, whoever asked for them; the answer is how many there were."""
        self._check_skill(skill)
        service = f"{self.root}/skill/{skill}/_action/cancel_goal"
        # A goal of zeros at a time of zero are all goals (action_msgs/srv/CancelGoal).
        return self._questions.ask(CancelGoal, service, CancelGoal.Request(), lambda response, _: len(response.goals_canceling))

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet; it fails when the managers go."""
        pending: Pending[Any] = Pending(self._host)
        self._moments.add(pending)
        return pending

    def close(self, reason: str) -> None:
        """End every wait for this reason; what runs goes on running."""
        self._give_up(reason)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _check_skill(self, skill: str) -> None:
        known = [known.name for known in self.model.skills]
        if skill not in known:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(known)}")

    def _goal(self, skill: str, inputs: Mapping[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        self._check_skill(skill)
        goal = self._presence.actions[skill].Goal()
        place = f"inputs of {self.skillset}.{skill}"
        fill(goal, inputs, place)
        missing = [name for name in fields_of(goal) if name not in inputs]
        if missing:
            raise ValueError(f"{place}: {', '.join(missing)} missing")
        return goal

    def _stillborn(self, skill: str) -> SkillHandle:
        handle = SkillHandle(skill, "", host=self._host)
        handle.fail(f"the managers of {self.skillset} are not there")
        return handle

    def _forget(self, handle: SkillHandle) -> None:
        with self._lock:
            self._open.pop(handle.id, None)

    def _pursuits(self) -> list[Pursuit]:
        with self._lock:
            return list(self._open.values())

    def _on_resources(self, message: Any) -> None:
        states = {resource.name: resource.state for resource in message.resources}
        with self._lock:
            self._resources = states
            callbacks = list(self._on_changes)
        for callback in callbacks:
            callback(dict(states))

    def _on_event(self, event: Any) -> None:
        if event.kind == Event.EXECUTION:
            pursuit = self._open.get(event.id)
            if pursuit is not None:
                pursuit.on_event(event)
                if pursuit.restless:
                    self._wake()
        with self._lock:
            callbacks = list(self._on_events)
        for callback in callbacks:
            callback(event)

    def _on_skill_states(self, message: Any) -> None:
        skills = {skill.name: skill for skill in message.skills}
        with self._lock:
            self._skills = skills
            callbacks = list(self._on_skills_told)
        for callback in callbacks:
            callback(dict(skills))

    def _wake(self) -> None:
        self._timer.reset()

    def _ask_again(self) -> None:
        """Have each execution's result asked for anew: managers that were started anew answer that they do not know it."""
        for pursuit in self._pursuits():
            pursuit.ask_again()

    def _on_gone(self) -> None:
        self._give_up(f"the managers of {self.skillset} have gone: they ended, or gave no sign of life for {LIVELINESS_LEASE_S:g} s")

    def _give_up(self, reason: str) -> None:
        for pursuit in self._pursuits():
            pursuit.abandon(reason)
        self._questions.give_up(reason)
        for moment in list(self._moments):
            moment.fail(reason)

    def _tick(self) -> None:
        if self._presence.restless:
            self._presence.tick()
        workers: list[Any] = [*self._pursuits(), self._questions, *list(self._feeds.values())]
        for worker in workers:
            if worker.restless:
                worker.tick()
        if not self._presence.restless and not any(worker.restless for worker in workers):
            self._timer.cancel()
