"""The client of a skillset in the same process, with the API of the one over rclpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from skill_language.model import Skillset
from skill_runtime.core.engine import TransitionReply
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.execution import ExecutionState
from skill_runtime.handle import Handle
from skill_runtime.local.data import DataReading
from skill_runtime.local.managers import LocalManagers
from skill_runtime.local.values import complete, fit

if TYPE_CHECKING:
    from skill_runtime.local.world import LocalWorld

OnChange = Callable[[dict[str, str]], None]
OnEvent = Callable[[str, EngineEvent], None]
OnData = Callable[[object], None]


class LocalHandle(Handle[dict[str, Any], str]):
    """An execution that was asked for; its waiting lets virtual time pass."""

    def __init__(self, world: LocalWorld, skill: str, execution_id: str, interrupt: Callable[[], None]) -> None:
        super().__init__(skill, execution_id, interrupt)
        self._world = world

    def wait(self, timeout_s: float) -> bool:
        """Let the world run (mission clock) until the execution has ended; tell whether it has.

        Raises:
            WorldError: from inside a job of the world, which would wait for itself.
        """
        return self.done or self._world.run_until(lambda: self.done, timeout_s=timeout_s)


class LocalClient:
    """Starts, watches and interrupts the skills of one skillset, and follows its resources, data and events.

    Nothing here waits but ``wait_ready``. All that crosses between client and managers takes the world's ``latency_s`` and at
    least the end of the present job, so ``start`` returns before anything has happened, as it does over a network.
    """

    def __init__(self, world: LocalWorld, name: str) -> None:
        self.skillset = name
        self._world = world
        self._managers: LocalManagers | None = None
        self._known: Skillset | None = None
        self._resources: dict[str, str] = {}
        self._open: dict[str, LocalHandle] = {}
        self._on_change: list[OnChange] = []
        self._on_event: list[OnEvent] = []
        self._on_data: dict[str, list[OnData]] = {}

    def wait_ready(self, timeout_s: float) -> bool:
        """Let the world run (mission clock) until the managers can be called; False when they can't within the time."""
        return self.ready or self._world.run_until(lambda: self.ready, timeout_s=timeout_s)

    @property
    def ready(self) -> bool:
        """Tell whether the managers are alive, known and can be called."""
        return self._managers is not None

    @property
    def model(self) -> Skillset:
        """Return the model that the managers execute; raise RuntimeError before ``wait_ready``."""
        if self._known is None:
            raise RuntimeError(f"the managers of {self.skillset} have not described themselves yet; call wait_ready first")
        return self._known

    @property
    def resources(self) -> dict[str, str]:
        """Return the state of every resource by name; empty until the managers were heard."""
        return dict(self._resources)

    def on_change(self, callback: OnChange) -> None:
        """Have ``callback(resources)`` called after each step that changed a resource."""
        self._on_change.append(callback)

    def on_event(self, callback: OnEvent) -> None:
        """Have ``callback(skillset, event)`` called for each event from now on."""
        self._on_event.append(callback)

    def on_data(self, name: str, callback: OnData) -> None:
        """Have ``callback(value)`` called for each new value of a data."""
        self._on_data.setdefault(name, []).append(callback)

    def get_data(self, name: str) -> DataReading:
        """Return what the managers know of a data now."""
        return DataReading(known=False) if self._managers is None else self._managers.data.read(name)

    def transition(self, resource: str, to: str) -> TransitionReply:
        """Take an extern transition, or say why not."""
        if self._managers is None:
            return TransitionReply(accepted=False, reason=self._not_there(), state="")
        return self._managers.transition(resource, to)

    def trigger(self, event: str) -> TransitionReply:
        """Take an event of the model, or say why not."""
        if self._managers is None:
            return TransitionReply(accepted=False, reason=self._not_there(), state="")
        return self._managers.engine.trigger(event)

    def start(self, skill: str, **inputs: object) -> LocalHandle:
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
        handle = LocalHandle(self._world, skill, identifier, lambda: self._world.send(lambda: managers.interrupt(identifier)))
        self._open[identifier] = handle
        self._world.send(lambda: managers.request(skill, values, identifier))
        return handle

    def _fitted(self, skill: str, inputs: Mapping[str, object]) -> dict[str, object]:
        """Return the inputs as the hooks get them; raise ValueError when skill or inputs are wrong."""
        skills = {known.name: known for known in self.model.skills}
        if skill not in skills:
            raise ValueError(f"skillset {self.skillset} has no skill {skill!r}; it has {', '.join(skills)}")
        place = f"inputs of {self.skillset}.{skill}"
        values = fit(skills[skill].inputs, inputs, place, self._world.types)
        missing = [parameter.name for parameter in skills[skill].inputs if parameter.name not in values]
        if missing:
            raise ValueError(f"{place}: {', '.join(missing)} missing")
        return values

    def _stillborn(self, skill: str) -> LocalHandle:
        handle = LocalHandle(self._world, skill, "", lambda: None)
        handle.fail(self._not_there())
        return handle

    def _not_there(self) -> str:
        return f"the managers of {self.skillset} are not there"

    # --- what the managers tell, each on its way through the world ---------------------------------------------------

    def meet(self, managers: LocalManagers) -> None:
        """Listen to managers that have come up; they can be called once their states have arrived."""
        managers.listen(self)
        self._world.send(lambda: self._get_known(managers))

    def hear_step(self, resources: Mapping[str, str] | None, events: Sequence[EngineEvent]) -> None:
        """Get one step; resources come before events before results, so that who sees a result sees its effects."""
        self._world.send(lambda: self._take_step(resources, events))

    def hear_progress(self, execution_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        """Get a report of a running execution."""
        self._world.send(lambda: self._take_progress(execution_id, progress, outputs))

    def hear_data(self, name: str, value: object) -> None:
        """Get a value."""
        self._world.send(lambda: self._take_data(name, value))

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
            if isinstance(event, ExecutionEvent) and event.id in self._open:
                self._follow(self._open[event.id], event)

    def _follow(self, handle: LocalHandle, event: ExecutionEvent) -> None:
        if event.state is ExecutionState.RUNNING:
            handle.run(0.0, dict(event.outputs))
        elif event.state.terminal:
            del self._open[event.id]
            outputs = complete(self.model.skill(event.skill).outputs, event.outputs, self._world.types)
            handle.end(event.state, event.result, event.message, outputs)

    def _take_progress(self, execution_id: str, progress: float, outputs: Mapping[str, object]) -> None:
        if execution_id in self._open:
            self._open[execution_id].run(progress, outputs)

    def _take_data(self, name: str, value: object) -> None:
        for on_data in self._on_data.get(name, ()):
            on_data(value)

    def _lose(self, reason: str) -> None:
        self._managers = None
        lost, self._open = self._open, {}
        for handle in lost.values():
            handle.fail(reason)
