"""The skillset interface library (paper, section 4.2), generic: all it needs it gets from ``describe`` and the generated actions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.node import Node
from skillset_interfaces.srv import GetData, SetPaused, Transition
from skillset_interfaces.srv import Why as WhyService

from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.callbacks import Forget
from skill_runtime.client_base import ClientBase
from skill_runtime.core.why import Why
from skill_runtime.handle import Ended, SkillHandle
from skill_runtime.messages import why_of
from skill_runtime.plain import to_plain
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.feed import TopicFeed
from skill_runtime.ros2.pursuit import Pursuit, outputs_of
from skill_runtime.ros2.questions import HOOK_PATIENCE_S
from skill_runtime.ros2.tracker import OnChange, OnEvent, OnSkills, Tracker
from skill_runtime.views import DataReading, SkillsetView, TransitionAnswer
from skill_runtime.waiting import Pending

__all__ = ["SkillHandle", "SkillsetClient"]

HOOK_AGAIN_S = 5.0
SERVICES = {"why": WhyService, "pause": SetPaused, "transition": Transition, "get_data": GetData}


class SkillsetClient(ClientBase):
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    Nothing here waits but ``wait_ready``. Callbacks come on the thread that spins ``node``, in a callback group of the client's
    own: with an executor of several threads, other callbacks may wait for a skill.

    Args:
        node: whose executor serves the client.
        name: the skillset.
        namespace: of the robot, as ``/robot1``; by default the node's.
    """

    def __init__(self, node: Node, name: str, *, namespace: str = "") -> None:
        self.root = f"{namespace.rstrip('/')}/{name}" if namespace else name
        self._tracker = Tracker(node, name, self.root)
        super().__init__(name, self._tracker.host)
        for service, kind in SERVICES.items():
            self._tracker.questions.prepare(kind, f"{self.root}/{service}")

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time.

        Spins the node when it has no executor; otherwise another thread must be spinning it.

        Raises:
            CannotWaitError: this thread spins the node itself.
        """
        return self.ready or self._host.wait(self._tracker.presence.ready, timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._tracker.presence.ready.is_set()

    @property
    def _described(self) -> Skillset | None:
        return self._tracker.presence.model

    @property
    def view(self) -> SkillsetView:
        """Return the skillset as attributes; raise RuntimeError before ``wait_ready``."""
        return SkillsetView(self)

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        return dict(self._tracker.resources)

    def on_change(self, callback: OnChange) -> Forget:
        """Have ``callback(resources)`` called after each step that changed a resource; the return value ends that."""
        return self._tracker.on_changes.add(callback)

    def on_event(self, callback: OnEvent) -> Forget:
        """Have ``callback(event)`` called for each skillset_interfaces/Event from now on; the return value ends that."""
        return self._tracker.on_events.add(callback)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._tracker.presence.model is None:
            return self._stillborn(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._stillborn(skill)
        actions, clients = self._tracker.presence.actions, self._tracker.presence.clients
        pursuit = Pursuit(self.skillset, skill, actions[skill], clients[skill], pause=self.set_paused, host=self._host)
        self._tracker.pursue(pursuit, goal)
        return pursuit.handle

    def last(self, skill: str) -> Ended[dict[str, Any], str] | None:
        """Return how the skill's last execution ended, whoever asked for it and whenever; None when none has.

        Raises:
            ValueError: there is no such skill.
        """
        self._check_skill(skill)
        known = self._tracker.skills.get(skill)
        if known is None or not known.last:
            return None
        last = known.last[0]
        outputs = outputs_of(self._tracker.presence.actions[skill], json.loads(last.outputs_json), skill)
        return Ended(skill, last.id, ExecutionState(last.state), last.result, last.message, outputs)

    def on_skills(self, callback: OnSkills) -> Forget:
        """Have ``callback(skills)`` called after changes, with a skillset_interfaces/SkillState by skill; the return value ends that."""
        return self._tracker.on_skills.add(callback)

    @property
    def skills(self) -> dict[str, Any]:
        """Return the skillset_interfaces/SkillState of every skill: what runs, and what ended last; empty until they were heard."""
        return dict(self._tracker.skills)

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask the managers whether the skill could start now, and if not, why not; with inputs its ``validate`` is asked, too.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        inputs_json = "" if inputs is None else json.dumps(to_plain(self._goal(skill, inputs)))
        self._check_skill(skill)
        request = WhyService.Request(skill=skill, inputs_json=inputs_json)
        answer = lambda response, _: why_of(skill, response)  # noqa: E731
        return self._tracker.questions.ask(
            WhyService, f"{self.root}/why", request, answer, patience_s=HOOK_PATIENCE_S, again_s=HOOK_AGAIN_S
        )

    def set_paused(self, execution_id: str, paused: bool) -> Pending[str]:  # noqa: FBT001 - as the service has it
        """Ask for a pause or a resumption; the answer is "", or why not."""
        request = SetPaused.Request(id=execution_id, paused=paused)
        answer = lambda response, _: "" if response.accepted else response.reason  # noqa: E731
        # Asked once only: a hook that takes its time would be asked again.
        return self._tracker.questions.ask(SetPaused, f"{self.root}/pause", request, answer, patience_s=HOOK_PATIENCE_S, again_s=math.inf)

    def transition(self, resource: str, to: str) -> Pending[TransitionAnswer]:
        """Ask for an extern transition, as the functional layer does."""

        def answer(response: Any, tries: int) -> TransitionAnswer:
            # An answer that got lost may have been that the transition was taken.
            accepted = response.accepted or (tries > 1 and response.state == to)
            return TransitionAnswer(accepted, "" if accepted else response.reason, response.state)

        request = Transition.Request(resource=resource, to=to)
        return self._tracker.questions.ask(Transition, f"{self.root}/transition", request, answer)

    def data_feed(self, name: str) -> TopicFeed:
        """Return the values of a data; it is subscribed to when it is first asked for.

        Raises:
            ValueError: there is no such data.
        """
        return self._tracker.feed(self._find_data(name))

    def read_data(self, name: str) -> Pending[DataReading]:
        """Ask the managers for a data's value as JSON: also of a type that is not known here."""

        def answer(response: Any, tries: int) -> DataReading:  # noqa: ARG001
            return DataReading(response.known, response.received, response.stale, response.stamp_ns, response.value_json)

        return self._tracker.questions.ask(GetData, f"{self.root}/get_data", GetData.Request(name=name), answer)

    def input_types(self, skill: str) -> dict[str, str]:
        """Return a skill's inputs with their ROS types, as ``{"height": "double"}``; raise ValueError."""
        self._check_skill(skill)
        return fields_of(self._tracker.presence.actions[skill].Goal)

    def interrupt_all(self, skill: str) -> Pending[int]:
        """Ask for the end of all executions of a skill, whoever asked for them; the answer is how many there were."""
        self._check_skill(skill)
        service = f"{self.root}/skill/{skill}/_action/cancel_goal"
        # A goal of zeros at a time of zero are all goals (action_msgs/srv/CancelGoal).
        return self._tracker.questions.ask(CancelGoal, service, CancelGoal.Request(), lambda response, _: len(response.goals_canceling))

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet; it fails when the managers go."""
        return self._tracker.moment()

    def close(self, reason: str) -> None:
        """End every wait for this reason; what runs goes on running."""
        self._tracker.give_up(reason)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _goal(self, skill: str, inputs: Mapping[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        self._check_skill(skill)
        goal = self._tracker.presence.actions[skill].Goal()
        fill(goal, inputs, self._place(skill))
        self._check_complete(skill, fields_of(goal), inputs)
        return goal
