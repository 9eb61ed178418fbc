"""What a mission needs of a skillset: the part of the client that the leaves use, and the client that wakes the tree and keeps record."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, Protocol

from alula.model.semantics import asked_data
from alula.runtime.client import Client as SkillsetClient
from alula.runtime.handle import SkillHandle

NANOSECONDS = 1e9
Clock = Callable[[], int]
"""Mission clock in nanoseconds."""


class Client(Protocol):
    """What a mission needs of a client of a skillset's managers."""

    @property
    def skillset(self) -> str:
        """Name of the skillset."""
        ...

    @property
    def ready(self) -> bool:
        """Return whether it can be called."""
        ...

    @property
    def resources(self) -> Mapping[str, str]:
        """State of every resource; empty until the skillset was heard of."""
        ...

    @property
    def reasons(self) -> Mapping[str, str]:
        """Why each resource is in its state, in the words of the functional layer; empty where it told nothing."""
        ...

    def follow(self, data: Collection[str]) -> None:
        """Have the values of these data at hand from when it can be called."""
        ...

    def value(self, data: str) -> object | None:
        """Return the last value of a data, None where there is none, or it is stale."""
        ...

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution; returns at once."""
        ...


class Recorder(Protocol):
    """What is written down of what passes between a tree and its skillsets."""

    def report(self, skillset: str, handle: SkillHandle) -> None:
        """Take a report of an execution to the tree."""
        ...

    def sample(self, skillset: str, data: str, value: object, stamp_ns: int | None) -> None:
        """Take a value of a data."""
        ...

    def decision(self, kind: str, skillset: str, skill: str, execution_id: str, inputs: Mapping[str, object]) -> None:
        """Take a request of the tree."""
        ...


class MissionClient:
    """A skillset's client that has the tree ticked at once when an execution ends or a resource changes.

    With a recorder it tells all that the tree asks for and is told. ``name`` is what the mission calls the skillset, where that is
    not its own name.
    """

    def __init__(self, client: SkillsetClient, wake: Callable[[], None], recorder: Recorder | None = None, name: str = "") -> None:
        self.client = client
        self.skillset = name or client.skillset
        self._wake = wake
        self._recorder = recorder
        self._followed: Collection[str] = ()
        self._follows_data = False
        client.on_change(lambda _: wake())

    @property
    def ready(self) -> bool:
        """Return whether it can be called."""
        if self.client.ready and not self._follows_data:
            self._follows_data = True
            self._follow_data()
        return self.client.ready

    @property
    def resources(self) -> Mapping[str, str]:
        """State of every resource; empty until the skillset was heard of."""
        return self.client.resources

    @property
    def reasons(self) -> Mapping[str, str]:
        """Why each resource is in its state, in the words of the functional layer; empty where it told nothing."""
        return self.client.reasons

    def follow(self, data: Collection[str]) -> None:
        """Have the values of these data at hand, and each of them recorded; to be called before `ready`."""
        self._followed = data

    def value(self, data: str) -> object | None:
        """Return the last value of a data, None where there is none, it is stale, or the skillset was not heard of yet."""
        if not (self._follows_data or self.ready):
            return None
        feed = self.client.data_feed(data)
        return None if feed.sample is None or feed.stale else feed.sample.value

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution, record it as a decision, and wake the mission when it ends."""
        handle = self.client.start(skill, **inputs)
        if self._recorder is not None:
            self._record(self._recorder, handle, inputs)
        handle.add_done_callback(lambda _: self._wake())
        return handle

    def _record(self, recorder: Recorder, handle: SkillHandle, inputs: Mapping[str, object]) -> None:
        recorder.decision("start", self.skillset, handle.skill, handle.id, inputs)
        if handle.done:  # it could not be asked for
            recorder.report(self.skillset, handle)
        handle.on_request(lambda kind: recorder.decision(kind, self.skillset, handle.skill, handle.id, {}))
        handle.on_report(lambda _: recorder.report(self.skillset, handle))

    def _follow_data(self) -> None:
        if self._recorder is None:
            for name in self._followed:
                self.client.data_feed(name)
            return
        asked_for = asked_data(self.client.model) | set(self._followed)
        for data in self.client.model.data:
            every_s = 0.0 if data.name in asked_for else 1.0
            self.client.data_feed(data.name, every_s).on_sample(self._sample_of(data.name))

    def _sample_of(self, name: str) -> Callable[[Any], None]:
        def record(sample: Any) -> None:
            if self._recorder is not None:
                self._recorder.sample(self.skillset, name, sample.value, sample.stamp_ns)

        return record
