"""What runs the core of a node: ROS in flight, a bag in a replay, a bench. The core says what it takes and gives; no rospy."""

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
    """A topic that a core takes: messages go to ``take``, what is none to ``garbage``, with a sentence.

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
        """Decode a message of the type that its publisher has told (``*``: any), and take it."""
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
    """What a core asks of what runs it; all may be called from any thread."""

    def now_ns(self) -> int:
        """Return the mission clock."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message on one of the core's outputs."""

    def wanted(self, topic: str) -> bool:
        """Return whether anybody takes what an output carries: what is dear to make is made for them alone."""

    def published(self, topic: str) -> bool:
        """Return whether an input has a publisher."""

    def done(self, stamp_ns: int) -> None:
        """Note that nothing is left to do for the measurement made at ``stamp_ns``."""

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Report the state of ``skillset.resource``; see ``resource_reporter.ResourceReporter``."""

    def offer(self, work: Callable[[], None]) -> None:
        """Have this done beside the inputs, one at a time; of what waits only the newest is."""

    def info(self, text: str) -> None:
        """Log."""

    def warn(self, about: str, text: str, *, every_s: float = 2.0) -> None:
        """Log a warning; of those ``about`` the same one in ``every_s``."""


class Core(Protocol):
    """What a node does, without rospy. Periodic work comes in seconds of mission clock."""

    @property
    def inputs(self) -> Sequence[Input]:
        """The topics that it takes."""

    @property
    def timers(self) -> Sequence[tuple[float, Callable[[], None]]]:
        """What it does again and again, with the period."""


@runtime_checkable
class Switched(Protocol):
    """A core with work that runs on demand has this, too."""

    enabled: bool

    def switch(self, enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        """Begin or end it."""
