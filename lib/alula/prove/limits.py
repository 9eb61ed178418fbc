"""Bounded time: what works for long asks now and then whether it may go on."""

from __future__ import annotations

import time
from dataclasses import dataclass

DEFAULT_TIME_S = 30.0
"""How long the proofs of a file may take."""


class OutOfTimeError(Exception):
    """The time given is over."""


@dataclass(frozen=True)
class Deadline:
    """A moment on the monotonic clock, seconds; ``given_s`` is what the user allowed."""

    at_s: float
    given_s: float

    @classmethod
    def after(cls, given_s: float) -> Deadline:
        """Return the moment so many seconds from now."""
        return cls(time.monotonic() + given_s, given_s)

    def left_s(self) -> float:
        """Return the seconds that are left, never below zero."""
        return max(0.0, self.at_s - time.monotonic())

    def check(self) -> None:
        """Raise OutOfTimeError when the moment has passed."""
        if time.monotonic() > self.at_s:
            raise OutOfTimeError
