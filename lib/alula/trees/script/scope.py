"""What a script asks of the world that it runs in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

Value: TypeAlias = object
"""``int`` (BT.CPP's 64-bit integers), ``float``, ``str``, ``bool`` (counts as the integer 0 or 1); None is an entry without a value.

Anything else is a value of the robot's own: a script copies it and can do no more with it.
"""


@dataclass(frozen=True)
class Unknown:
    """The value of what is not known now, such as data that are too old; ``why`` is a sentence.

    What is made of it is unknown, too, unless the other operand of `&&` or `||` decides (Kleene's logic); as a condition it is false.
    """

    why: str

    def __str__(self) -> str:
        """Return why it is not known."""
        return self.why


class Reference(str):
    """A name that stands alone as an argument of a call: it is passed on as it is, not as its value."""

    __slots__ = ()


class Scope(Protocol):
    """The names that a script can use: a blackboard, and what a robot adds to it."""

    @property
    def enums(self) -> Mapping[str, float]:
        """Names of numbers. They come before entries, and stand for a number in a text that is compared with one."""

    def get(self, name: str) -> Value:
        """Return the value of an entry or of a dotted name, None if it has none yet; raise KeyError if there is no such name."""

    def set(self, name: str, value: Value, *, create: bool) -> None:
        """Write an entry; ``create`` makes one that is not there, which is asked for by ``:=`` alone.

        The value has the type of the value that it replaces. Raise KeyError where nothing may be written, ValueError or TypeError
        for a value that the entry does not take, with a message for the user.
        """

    def call(self, name: str, args: Sequence[Value]) -> Value:
        """Return what a function answers; raise KeyError if there is none, ValueError or TypeError for wrong arguments."""
