"""A skillset as attributes: its skills to call, its resources and data to look at; the same over every middleware.

The generated clients (``<skillset>_managers.client``, ``<robot>_client``) are these classes with types.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, cast

from alula.model.model import Skillset
from alula.runtime.callbacks import Unsubscribe
from alula.runtime.core.replies import TransitionReply
from alula.runtime.core.why import Why
from alula.runtime.handle import Ended, Handle, OutputsT, ResultT
from alula.runtime.waiting import Pending

StateT = TypeVar("StateT", bound=str)
ValueT = TypeVar("ValueT")
NANOSECONDS = 1e9


@dataclass(frozen=True)
class Sample:
    """A value of a data, and when the data manager received it (mission clock; None while that is not known)."""

    value: Any
    stamp_ns: int | None


@dataclass(frozen=True)
class DataReading:
    """A data as its managers know it; stamp and value only when something was received."""

    known: bool
    received: bool
    stale: bool
    stamp_ns: int
    value_json: str

    @property
    def value(self) -> Any:
        """The value, as JSON has it; None when nothing was received."""
        return json.loads(self.value_json) if self.value_json else None


class DataFeed(Protocol):
    """The values of one data, as a client gets them."""

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        ...

    @property
    def stale(self) -> bool:
        """Return whether there is no value, or it is older than the model's period allows."""
        ...

    def on_sample(self, callback: Callable[[Sample], None]) -> Unsubscribe:
        """Call ``callback(sample)`` for each value from now on."""
        ...


class Access(Protocol):
    """What the views need of a client; ``SkillsetClient`` has it."""

    @property
    def skillset(self) -> str:
        """Name of the skillset."""
        ...

    @property
    def model(self) -> Skillset:
        """The model that the managers execute."""
        ...

    @property
    def resources(self) -> dict[str, str]:
        """State of each resource by name, as last received."""
        ...

    @property
    def reasons(self) -> dict[str, str]:
        """The reason for each resource's state, by name, as last received."""
        ...

    def on_change(self, callback: Callable[[dict[str, str]], None]) -> Unsubscribe:
        """Call ``callback(resources)`` after each step that changed a resource."""
        ...

    def start(self, skill: str, **inputs: object) -> Handle[Any, Any]:
        """Ask the managers for an execution; return its handle."""
        ...

    def last(self, skill: str) -> Ended[Any, Any] | None:
        """Return how the skill's last execution ended, of any caller."""
        ...

    def why(self, skill: str, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask whether the skill could start now."""
        ...

    def transition(self, resource: str, to: str, reason: str = "") -> Pending[TransitionReply]:
        """Ask for an extern transition."""
        ...

    def data_feed(self, name: str) -> DataFeed:
        """Return the values of a data, followed from the first time that they are asked for."""
        ...

    def moment(self) -> Pending[Any]:
        """Return an answer to be resolved by the caller, and waited for as all others of this client."""
        ...


class Skill(Generic[OutputsT, ResultT]):
    """One skill; the generated clients add a ``__call__`` with its inputs."""

    def __init__(self, client: Access, name: str) -> None:
        self.name = name
        self._client = client

    def start(self, inputs: Mapping[str, object]) -> Handle[OutputsT, ResultT]:
        """Start an execution with the inputs by name; never waits. See ``SkillsetClient.start``."""
        return cast("Handle[OutputsT, ResultT]", self._client.start(self.name, **inputs))

    @property
    def last(self) -> Ended[OutputsT, ResultT] | None:
        """How the last execution ended, of any caller and at any time: also before this client was there."""
        return self._client.last(self.name)

    def why(self, inputs: Mapping[str, object] | None = None) -> Pending[Why]:
        """Ask whether the skill could start now, and if not, why not; with inputs, its ``validate`` is asked, too."""
        return self._client.why(self.name, inputs)


class SkillView(Skill[dict[str, Any], str]):
    """One skill by its name: call it to start it."""

    def __call__(self, **inputs: object) -> Handle[dict[str, Any], str]:
        """Start an execution; never waits. See ``SkillsetClient.start``."""
        return self.start(inputs)


class ResourceView(Generic[StateT]):
    """One resource of a skillset, as a client sees it; ``StateT`` is its generated enum."""

    def __init__(self, client: Access, name: str) -> None:
        self.name = name
        self._client = client

    @property
    def state(self) -> StateT:
        """Its state now.

        Raises:
            RuntimeError: the managers were not heard yet.
        """
        state = self._client.resources.get(self.name)
        if state is None:
            raise RuntimeError(f"no state of {self._client.skillset}.{self.name} has been received yet; call wait_ready first")
        return cast("StateT", state)

    @property
    def reason(self) -> str:
        """The reason that the functional layer reported for its state; empty where it reported none."""
        return self._client.reasons.get(self.name, "")

    def on_change(self, callback: Callable[[StateT], None]) -> Unsubscribe:
        """Call ``callback(state)`` after each change, on the thread that brings it; the return value unsubscribes."""
        known = [self._client.resources.get(self.name)]

        def look(states: dict[str, str]) -> None:
            state = states.get(self.name)
            if state is not None and state != known[0]:
                known[0] = state
                callback(cast("StateT", state))

        return self._client.on_change(look)

    def becomes(self, *states: StateT) -> Pending[StateT]:
        """Return an answer that comes when the resource is in one of the states: ``becomes("IN_AIR").wait(timeout_s)``, or await it."""
        reached: Pending[StateT] = self._client.moment()

        def look(now: dict[str, str]) -> None:
            state = now.get(self.name)
            if state in states:
                reached.resolve(state)

        forget = self._client.on_change(look)
        reached.add_done_callback(lambda _: forget())
        look(self._client.resources)
        return reached

    def transition(self, to: StateT, reason: str = "") -> Pending[TransitionReply]:
        """Take an extern transition, as the functional layer does; refused with a reason when the model has no such transition."""
        return self._client.transition(self.name, to, reason)


class DataView(Generic[ValueT]):
    """One data; its values are followed from the first time that this view is asked for one."""

    def __init__(self, client: Access, name: str) -> None:
        self.name = name
        self._client = client

    @property
    def value(self) -> ValueT | None:
        """The last value, however old; None before the first."""
        sample = self._client.data_feed(self.name).sample
        return None if sample is None else cast("ValueT", sample.value)

    @property
    def stamp(self) -> float | None:
        """When the data manager received it, in seconds of mission clock."""
        sample = self._client.data_feed(self.name).sample
        return None if sample is None or sample.stamp_ns is None else sample.stamp_ns / NANOSECONDS

    @property
    def stale(self) -> bool:
        """Return whether there is no value, or it is older than the model's period allows."""
        return self._client.data_feed(self.name).stale

    def on_change(self, callback: Callable[[ValueT], None]) -> Unsubscribe:
        """Call ``callback(value)`` for each value, on the thread that brings it; the return value unsubscribes."""
        return self._client.data_feed(self.name).on_sample(lambda sample: callback(cast("ValueT", sample.value)))

    def next(self) -> Pending[ValueT]:
        """Return an answer that comes with the next value: ``next().get(timeout_s)``, or await it."""
        arrival: Pending[ValueT] = self._client.moment()
        forget = self._client.data_feed(self.name).on_sample(lambda sample: arrival.resolve(cast("ValueT", sample.value)))
        arrival.add_done_callback(lambda _: forget())
        return arrival


class TypedSkillset:
    """A skillset as the generated clients make it: attributes for its skills and resources, ``data`` for its data."""

    def __init__(self, client: Access) -> None:
        self.client = client


class SkillsetView:
    """A skillset by its model, without generated code: ``skillset.takeoff(height=5.0)``, ``skillset.flight_status.state``.

    A name is looked up among the skills, then the resources; ``skills``, ``resources`` and ``data`` have all of them.
    """

    def __init__(self, client: Access) -> None:
        self.client = client
        model = client.model
        self.skills = {skill.name: SkillView(client, skill.name) for skill in model.skills}
        self.resources = {resource.name: ResourceView[str](client, resource.name) for resource in model.resources}
        self.data = DataViews({data.name: DataView[Any](client, data.name) for data in model.data}, client.skillset)

    def __getattr__(self, name: str) -> Any:
        found: object = vars(self).get("skills", {}).get(name) or vars(self).get("resources", {}).get(name)
        if found is None:
            known = ", ".join([*vars(self).get("skills", ()), *vars(self).get("resources", ())])
            raise AttributeError(f"the skillset has no skill or resource {name!r}; it has {known}")
        return found

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.skills, *self.resources]


class DataViews(dict[str, DataView[Any]]):
    """The data of a skillset by name, as items and as attributes."""

    def __init__(self, views: Mapping[str, DataView[Any]], skillset: str) -> None:
        super().__init__(views)
        self._skillset = skillset

    def __getattr__(self, name: str) -> DataView[Any]:
        if name in self:
            return self[name]
        raise AttributeError(f"skillset {self._skillset} has no data {name!r}; it has {', '.join(self) or 'none'}")
