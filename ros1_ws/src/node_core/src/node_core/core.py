"""The host of a node's core: ROS in flight, a bag in a replay, a bench. The core declares its inputs and outputs; no rospy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import genpy


@dataclass(frozen=True)
class Output:
    """A topic that a core publishes; ``~`` begins the names of its own.

    ``shared``: other nodes publish it, too. What a record has there stands in a replay.
    ``taken``: the topic on which the reader says what it has taken; a measurement is dealt with when it has. Messages have a header.
    """

    topic: str
    kind: type[Any]
    queue_size: int = 1
    latch: bool = False
    tcp_nodelay: bool = False
    shared: bool = False
    taken: str = ""


@dataclass(frozen=True)
class Input:
    """A topic that a core takes: messages go to ``take``; of what can't be decoded, the reason goes to ``garbage``.

    Of a topic that carries much for others, those messages alone are decoded whose bytes hold the word ``about``.
    """

    topic: str
    kind: type[Any]
    take: Callable[[Any], None]
    garbage: Callable[[str], None] = lambda _reason: None
    buffer_bytes: int = 1 << 16
    queue_size: int = 1
    about: bytes = b""

    def take_bytes(self, sent: str, data: bytes) -> None:
        """Decode a message of the type that its publisher declares (``*``: any), and take it."""
        wanted = self.kind._type  # noqa: SLF001 -- generated messages have it
        if sent not in {"*", wanted}:
            self.garbage(f"{self.topic} carries {sent}, expected {wanted}")
            return
        if self.about not in data:
            return
        message = self.kind()
        try:
            message.deserialize(data)
        except (genpy.DeserializationError, ValueError, MemoryError) as error:
            self.garbage(f"a message of {len(data)} bytes can't be decoded: {error}")
            return
        self.take(message)


class Host(Protocol):
    """What a core needs from its host; all may be called from any thread."""

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message on one of the core's outputs."""

    def wanted(self, topic: str) -> bool:
        """Return whether an output has a reader: what is expensive is computed only for one."""

    def published(self, topic: str) -> bool:
        """Return whether an input has a publisher."""

    def done(self, stamp_ns: int) -> None:
        """Report that the measurement made at ``stamp_ns`` is processed."""

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Report the state of ``skillset.resource``; see ``resource_reporter.ResourceReporter``."""

    def offer(self, work: Callable[[], None]) -> None:
        """Run this beside the inputs, one at a time; of the waiting ones only the newest is kept."""

    def info(self, text: str) -> None:
        """Log a text."""

    def warn(self, about: str, text: str, *, every_s: float = 2.0) -> None:
        """Log a warning; of those with the same ``about`` one in ``every_s``."""


class Core(Protocol):
    """What a node does, without rospy. Periodic work comes in seconds of mission clock."""

    @property
    def inputs(self) -> Sequence[Input]:
        """The topics that it takes."""

    @property
    def timers(self) -> Sequence[tuple[float, Callable[[], None]]]:
        """Its periodic work, with the periods in seconds."""


@runtime_checkable
class Switched(Protocol):
    """A core with work that runs on demand has this, too."""

    enabled: bool

    def switch(self, enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        """Begin or end the work."""
