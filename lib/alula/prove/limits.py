"""Bounded time: long computations check now and then whether they may go on."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from alula.common.errors import AlulaError

DEFAULT_TIME_S = 30.0
"""How long the proofs of a file may take."""


EVERY_S = 5.0
"""How often a long search reports its progress."""


class OutOfTimeError(AlulaError):
    """The time given is over."""


def _now_s() -> float:
    return time.monotonic()


@dataclass
class Deadline:
    """A moment on the monotonic clock, seconds; ``given_s`` is what the user allowed.

    ``on_progress`` is called with what is being done and for how long, every few seconds of a long search.
    """

    at_s: float
    given_s: float
    on_progress: Callable[[str], None] | None = None
    doing: str = ""
    _begun_s: float = field(default_factory=_now_s)
    _reported_s: float = field(default_factory=_now_s)

    @classmethod
    def after(cls, given_s: float, on_progress: Callable[[str], None] | None = None) -> Deadline:
        """Return the moment so many seconds from now."""
        return cls(_now_s() + given_s, given_s, on_progress)

    def half(self, doing: str) -> Deadline:
        """Return the deadline in the middle of the time left, for a computation called ``doing``."""
        return replace(self, at_s=self.at_s - self.left_s() / 2, doing=doing)

    def left_s(self) -> float:
        """Return the seconds that are left, never below zero."""
        return max(0.0, self.at_s - _now_s())

    def a_second(self, count: int) -> float:
        """Return the rate of ``count`` items, per second since the beginning."""
        return count / max(_now_s() - self._begun_s, 1e-3)

    def check(self) -> None:
        """Raise OutOfTimeError when the moment has passed."""
        now_s = _now_s()
        if now_s > self.at_s:
            raise OutOfTimeError
        if self.on_progress is not None and now_s - self._reported_s >= EVERY_S:
            self._reported_s = now_s
            self.on_progress(f"{self.doing}; {now_s - self._begun_s:.0f} s of {self.given_s:.3g} s")
