"""The skillset interface library (paper, section 4.2) over rospy, generic: all it needs it gets from ``describe``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from skillset_interfaces.srv import GetData, GetDataRequest, SetPaused, SetPausedRequest, Transition, TransitionRequest, WhyRequest
from skillset_interfaces.srv import Why as WhyService

from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.callbacks import Forget
from skill_runtime.client_base import ClientBase
from skill_runtime.core.why import Why
from skill_runtime.handle import Ended, SkillHandle
from skill_runtime.messages import why_of
from skill_runtime.plain import to_plain
from skill_runtime.views import DataReading, SkillsetView, TransitionAnswer
from skill_runtime.waiting import Pending
from skillset_ros1.convert import fields_of, fill
from skillset_ros1.feed import TopicFeed
from skillset_ros1.names import place
from skillset_ros1.pursuit import Pursuit, outputs_of, result_of
from skillset_ros1.questions import HOOK_PATIENCE_S
from skillset_ros1.session import Session

OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[Any], None]
OnSkills = Callable[[dict[str, Any]], None]


class SkillsetClient(ClientBase):
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    What the client of the ROS 2 world does, and the typed clients that are generated work on either. Nothing here waits but
    ``wait_ready``. Callbacks come on the client's own thread.

    Args:
        name: the skillset.
        namespace: of the robot, as ``/robot1``; by default that of this process's node.
    """

    def __init__(self, name: str, *, namespace: str = "") -> None:
        self.root = place(namespace, name)
        self._session = Session(self.root, name)
        super().__init__(name, self._session)
        self._questions = self._session.questions
        self._feeds: dict[str, TopicFeed] = {}

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait (wall clock) until the managers can be called; False when they can't within the time.

        Raises:
            CannotWaitError: this is the client's own thread.
        """
        return self.ready or self._session.wait(self._session.reach.ready, timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._session.reach.ready.is_set()

    @property
    def _described(self) -> Skillset | None:
        return self._session.reach.model

    @property
    def view(self) -> SkillsetView:
        """Return the skillset as attributes; raise RuntimeError before ``wait_ready``."""
        return SkillsetView(self)

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        with self._session.lock:
            return dict(self._session.resources)

    def on_change(self, callback: OnChange) -> Forget:
        """Have ``callback(resources)`` called after each step that changed a resource; the return value ends that."""
        return self._session.on_changes.add(callback)

    def on_event(self, callback: OnEvent) -> Forget:
        """Have ``callback(event)`` called for each skillset_interfaces/Event from now on; the return value ends that."""
        return self._session.on_events.add(callback)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A ``geometry_msgs/Point`` may be given as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._session.reach.model is None:
            return self._stillborn(skill)
        goal = self._goal(skill, inputs)
        if not self.ready:
            return self._stillborn(skill)
        session = self._session
        pursuit = Pursuit(self.skillset, skill, session.reach.links[skill], session.do, self.set_paused, session)
        return pursuit.handle if session.pursue(pursuit, goal) else self._stillborn(skill)

    def last(self, skill: str) -> Ended[dict[str, Any], str] | None:
        """Return how the skill's last execution ended, whoever asked for it and whenever; None when none has.

        Raises:
            ValueError: there is no such skill.
        """
        self._check_skill(skill)
        known = self._session.last.get(skill)
        if known is None:
            return None
        result = result_of(self._session.reach.links[skill].types.result, skill, known[1])
        return Ended(skill, known[1].id, ExecutionState(result.outcome), result.result, result.message, outputs_of(result))

    def on_skills(self, callback: OnSkills) -> Forget:
        """Have ``callback(skills)`` called after changes, with a skillset_interfaces/SkillState by skill; the return value ends that."""
        return self._session.on_skills.add(callback)

    @property
    def skills(self) -> dict[str, Any]:
        """Return the skillset_interfaces/SkillState of every skill: what runs, and what ended last; empty until they were heard."""
        return dict(self._session.skills)

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask whether the skill could start now, and if not, why not; with inputs, its ``validate`` is asked, too.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit.
        """
        self._check_skill(skill)
        inputs_json = "" if inputs is None else json.dumps(to_plain(self._goal(skill, inputs)))
        request = WhyRequest(skill=skill, inputs_json=inputs_json)
        return self._questions.ask("why", WhyService, request, lambda response: why_of(skill, response), patience_s=HOOK_PATIENCE_S)

    def set_paused(self, execution_id: str, paused: bool) -> Pending[str]:  # noqa: FBT001 - as the service has it
        """Ask for a pause or a resumption; the answer is "", or why not."""
        request, answer = SetPausedRequest(id=execution_id, paused=paused), lambda response: "" if response.accepted else response.reason
        return self._questions.ask("pause", SetPaused, request, answer, patience_s=HOOK_PATIENCE_S)

    def transition(self, resource: str, to: str) -> Pending[TransitionAnswer]:
        """Ask for an extern transition, as the functional layer does."""
        request = TransitionRequest(resource=resource, to=to)
        return self._questions.ask("transition", Transition, request, lambda r: TransitionAnswer(r.accepted, r.reason, r.state))

    def data_feed(self, name: str) -> TopicFeed:
        """Return the values of a data; it is subscribed to when it is first asked for.

        Raises:
            ValueError: there is no such data.
        """
        data = self._find_data(name)
        with self._session.lock:
            if name not in self._feeds:
                self._feeds[name] = TopicFeed(self.root, data, self._questions, self._session.do)
            return self._feeds[name]

    def read_data(self, name: str) -> Pending[DataReading]:
        """Ask the managers for a data's value as JSON: also of a type that is not known here."""

        def answer(response: Any) -> DataReading:
            return DataReading(response.known, response.received, response.stale, response.stamp_ns, response.value_json)

        return self._questions.ask("get_data", GetData, GetDataRequest(name=name), answer)

    def input_types(self, skill: str) -> dict[str, str]:
        """Return a skill's inputs with their ROS 1 types, as ``{"height": "float64"}``; raise ValueError."""
        self._check_skill(skill)
        return fields_of(self._session.reach.links[skill].types.goal)

    def interrupt_all(self, skill: str) -> Pending[int]:
        """Ask for the end of all executions of a skill, whoever asked for them; the answer is how many there were."""
        self._check_skill(skill)
        answer: Pending[int] = self._questions.moment()

        def cancel() -> None:
            self._session.reach.links[skill].cancel_all()
            answer.resolve(len(self._session.skills[skill].open) if skill in self._session.skills else 0)

        self._session.do(cancel)
        return answer

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet; it fails when the managers go."""
        return self._questions.moment()

    def close(self, reason: str = "") -> None:
        """End every wait for this reason, and this client's connections; what runs goes on running."""
        self._session.close(reason or f"the client of {self.skillset} was closed")
        for feed in self._feeds.values():
            feed.close()

    # --- inside ------------------------------------------------------------------------------------------------------

    def _goal(self, skill: str, inputs: Mapping[str, object]) -> Any:
        """Make the goal message; raise ValueError when skill or inputs are wrong."""
        self._check_skill(skill)
        goal = self._session.reach.links[skill].types.goal()
        fill(goal, inputs, self._place(skill))
        self._check_complete(skill, fields_of(goal), inputs)
        return goal
