"""The client of a skillset in the same process, with the API of the one over rclpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakSet

from skill_model.execution_state import ExecutionState
from skill_model.model import Parameter, Skillset
from skill_runtime.callbacks import Callbacks, Forget
from skill_runtime.client_base import ClientBase
from skill_runtime.core.engine import TransitionReply
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.records import ExecutionRecord
from skill_runtime.core.why import Why
from skill_runtime.handle import Ended, SkillHandle
from skill_runtime.local.data import DataReading
from skill_runtime.local.host import LocalHost
from skill_runtime.local.managers import LocalManagers
from skill_runtime.local.values import complete, fit
from skill_runtime.samples import SampleFeed
from skill_runtime.views import Sample, SkillsetView, TransitionAnswer
from skill_runtime.waiting import Pending

if TYPE_CHECKING:
    from skill_runtime.local.world import LocalWorld

OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[str, EngineEvent], None]
T = TypeVar("T")


class LocalClient(ClientBase):
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    Nothing here waits but ``wait_ready``. All that crosses between client and managers takes the world's ``latency_s`` and at
    least the end of the present job, so ``start`` returns before anything has happened, as it does over a network.
    """

    def __init__(self, world: LocalWorld, name: str) -> None:
        super().__init__(name, LocalHost(world))
        self._world = world
        self._managers: LocalManagers | None = None
        self._known: Skillset | None = None
        self._resources: dict[str, str] = {}
        self._outputs: dict[str, Sequence[Parameter]] = {}
        self._open: dict[str, SkillHandle] = {}
        self._last: dict[str, Ended[dict[str, Any], str]] = {}
        self._on_change: Callbacks[OnChange] = Callbacks()
        self._on_event: Callbacks[OnEvent] = Callbacks()
        self._feeds: dict[str, SampleFeed] = {}
        self._samples: dict[str, Sample] = {}
        self._pending: WeakSet[Pending[Any]] = WeakSet()

    def wait_ready(self, timeout_s: float) -> bool:
        """Let the world run (mission clock) until the managers can be called; False when they can't within the time."""
        return self.ready or self._world.run_until(lambda: self.ready, timeout_s=timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._managers is not None

    @property
    def _described(self) -> Skillset | None:
        return self._known

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        return dict(self._resources)

    @property
    def view(self) -> SkillsetView:
        """Return the skillset as attributes; raise RuntimeError before ``wait_ready``."""
        return SkillsetView(self)

    def on_change(self, callback: OnChange) -> Forget:
        """Have ``callback(resources)`` called after each step that changed a resource; the return value ends that."""
        return self._on_change.add(callback)

    def on_event(self, callback: OnEvent) -> Forget:
        """Have ``callback(skillset, event)`` called for each event from now on; the return value ends that."""
        return self._on_event.add(callback)

    def data_feed(self, name: str) -> SampleFeed:
        """Return the values of a data.

        Raises:
            ValueError: there is no such data.
        """
        data = self._find_data(name)
        if name not in self._feeds:
            self._feeds[name] = SampleFeed(data, lambda: self._world.clock.now_ns)
            if name in self._samples:
                self._feeds[name].keep(self._samples[name])
        return self._feeds[name]

    def get_data(self, name: str) -> DataReading:
        """Return what the managers know of a data now."""
        return DataReading(known=False) if self._managers is None else self._managers.data.read(name)

    def transition(self, resource: str, to: str) -> Pending[TransitionAnswer]:
        """Ask for an extern transition, as the functional layer does."""
        return self._ask(lambda managers, reply: reply(_answered(managers.transition(resource, to))))

    def trigger(self, event: str) -> Pending[TransitionAnswer]:
        """Ask for an event of the model."""
        return self._ask(lambda managers, reply: reply(_answered(managers.engine.trigger(event))))

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask whether the skill could start now, and if not, why not; with inputs its ``validate`` is asked, too.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        self._check_skill(skill)
        values = None if inputs is None else self._fitted(skill, inputs)
        return self._ask(lambda managers, reply: reply(managers.why(skill, values)))

    def set_paused(self, execution_id: str, paused: bool) -> Pending[str]:  # noqa: FBT001 - as the client over rclpy
        """Ask for a pause or a resumption; the answer is "", or why not."""
        return self._ask(
            lambda managers, reply: managers.set_paused(
                execution_id, lambda answer: reply("" if answer.accepted else answer.reason), paused=paused
            )
        )

    def last(self, skill: str) -> Ended[dict[str, Any], str] | None:
        """Return how the skill's last execution ended, whoever asked for it and whenever; None when none has.

        Raises:
            ValueError: there is no such skill.
        """
        self._check_skill(skill)
        return self._last.get(skill)

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet; it fails when the managers go."""
        pending: Pending[Any] = Pending(self._host)
        self._pending.add(pending)
        return pending

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution; returns at once. When the managers can't be called, the handle has already FAILED.

        A message may be given as a mapping of its fields, a point as three numbers.

        Raises:
            ValueError: there is no such skill, or the inputs do not fit; nothing was sent.
        """
        if self._known is None:
            return self._stillborn(skill)
        values = self._fitted(skill, inputs)
        managers = self._managers
        if managers is None:
            return self._stillborn(skill)
        identifier = self._world.next_id()
        interrupt = lambda: self._world.send(lambda: managers.interrupt(identifier))  # noqa: E731
        pause = lambda paused: self.set_paused(identifier, paused)  # noqa: E731
        handle = SkillHandle(skill, identifier, interrupt, pause=pause, host=self._host)
        self._open[identifier] = handle
        self._world.send(lambda: managers.request(skill, values, identifier))
        return handle

    def _ask(self, question: Callable[[LocalManagers, Callable[[T], None]], None]) -> Pending[T]:
        """Send a question to the managers; the answer comes the same way back."""
        pending: Pending[T] = self.moment()
        managers = self._managers
        if managers is None:
            pending.fail(self._not_there())
            return pending

        def arrive() -> None:
            if managers.alive:
                question(managers, lambda answer: self._world.send(lambda: pending.resolve(answer)))

        self._world.send(arrive)
        return pending

    def _fitted(self, skill: str, inputs: Mapping[str, object]) -> dict[str, object]:
        """Return the inputs as the hooks get them; raise ValueError when skill or inputs are wrong."""
        self._check_skill(skill)
        declared = self.model.skill(skill).inputs
        values = fit(declared, inputs, self._place(skill), self._world.types)
        self._check_complete(skill, (parameter.name for parameter in declared), values)
        return values

    # --- what the managers tell, each on its way through the world ---------------------------------------------------

    def meet(self, managers: LocalManagers) -> None:
        """Listen to managers that have come up; they can be called once their states have arrived."""
        self._outputs = {skill.name: skill.outputs for skill in managers.skillset.skills}
        managers.listen(self)
        self._world.send(lambda: self._get_known(managers))

    def hear_step(self, resources: Mapping[str, str] | None, events: Sequence[EngineEvent]) -> None:
        """Get one step; resources come before events before results, so that who sees a result sees its effects."""
        self._world.send(lambda: self._take_step(resources, events))

    def hear_progress(self, execution_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Get a report of a running execution."""
        self._world.send(lambda: self._take_progress(execution_id, progress, outputs))

    def hear_data(self, name: str, sample: Sample) -> None:
        """Get a value."""
        self._world.send(lambda: self._take_sample(name, sample))

    def hear_last(self, records: Sequence[ExecutionRecord]) -> None:
        """Learn how the last execution of each skill ended."""
        self._world.send(lambda: self._take_last(records))

    def hear_end(self, reason: str) -> None:
        """Learn that the managers have gone."""
        self._world.send(lambda: self._lose(reason))

    def _get_known(self, managers: LocalManagers) -> None:
        self._managers, self._known = managers, managers.skillset

    def _take_step(self, resources: Mapping[str, str] | None, events: Sequence[EngineEvent]) -> None:
        if resources is not None:
            self._resources = dict(resources)
            for on_change in self._on_change:
                on_change(dict(resources))
        for event in events:
            for on_event in self._on_event:
                on_event(self.skillset, event)
        for event in events:
            if isinstance(event, ExecutionEvent):
                self._follow(event)

    def _follow(self, event: ExecutionEvent) -> None:
        """Bring the last end, and the handle if it is one of ours, up to date."""
        handle = self._open.get(event.id)
        if event.state.terminal:
            ended = self._take_end(event)
            if handle is not None:
                del self._open[event.id]
                handle.end(ended.state, ended.result, ended.message, ended.outputs)
        elif handle is not None and event.state is not ExecutionState.REQUESTED:
            handle.enter(event.state)

    def _take_end(self, event: ExecutionEvent | ExecutionRecord) -> Ended[dict[str, Any], str]:
        outputs = complete(self._outputs.get(event.skill, ()), event.outputs, self._world.types)
        ended = self._last[event.skill] = Ended(event.skill, event.id, event.state, event.result, event.message, outputs)
        return ended

    def _take_progress(self, execution_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        if execution_id in self._open:
            self._open[execution_id].run(progress, outputs)

    def _take_sample(self, name: str, sample: Sample) -> None:
        self._samples[name] = sample
        if name in self._feeds:
            self._feeds[name].keep(sample)

    def _take_last(self, records: Sequence[ExecutionRecord]) -> None:
        for record in records:
            self._take_end(record)

    def _lose(self, reason: str) -> None:
        self._managers = None
        lost, self._open = self._open, {}
        for handle in lost.values():
            handle.fail(reason)
        for pending in list(self._pending):
            pending.fail(reason)


def _answered(reply: TransitionReply) -> TransitionAnswer:
    return TransitionAnswer(reply.accepted, reply.reason, reply.state)
