"""Whether managers live, from what is heard of them; no ROS, no threads. Times are seconds of a clock that only grows."""

from __future__ import annotations

from enum import Enum

from skill_runtime.core.errors import SkillRuntimeError

ALIVE_PERIOD_S = 0.5
"""Managers give a sign of life so often (wall clock), whatever their hooks do."""
LEASE_S = 2.0
"""Without a sign of life for so long (wall clock), managers are doubted, as in the ROS 2 world."""
BROKEN_LEASE_S = 1.5 * ALIVE_PERIOD_S
"""The same where also the connection over which the signs come is broken."""
DOUBT_S = 1.0
"""Doubted managers that do not answer a question for so long are gone."""


class Verdict(Enum):
    """What is to be done."""

    NOTHING = "nothing"
    ASK = "ask"
    GONE = "gone"


class Presence:
    """Signs of life, doubt, and certainty.

    A silent process may only be starved, and a broken connection may be about to be made anew: before managers are taken for
    dead they are asked, and it is their answer that counts.
    """

    def __init__(self) -> None:
        self.life = ""
        self.alive = False
        self._past: set[str] = set()
        self._heard_s = 0.0
        self._doubt_ends_s: float | None = None

    def heard(self, life: str, now_s: float) -> bool:
        """Note a sign of life; False when it comes, late, from managers that others have replaced.

        Raises:
            SkillRuntimeError: it does not say whose it is.
        """
        if not life:
            raise SkillRuntimeError("a sign of life without a name: are these managers of another version?")
        if life in self._past:
            return False
        if self.life not in {"", life}:
            self._past.add(self.life)
        self.life, self.alive = life, True
        self._heard_s, self._doubt_ends_s = now_s, None
        return True

    def answered(self, now_s: float) -> None:
        """Note that doubted managers have answered."""
        if self._doubt_ends_s is not None:
            self._heard_s, self._doubt_ends_s = now_s, None

    def check(self, now_s: float, *, connected: bool) -> Verdict:
        """Say what is to be done now; ASK and GONE come once each."""
        if not self.alive:
            return Verdict.NOTHING
        if self._doubt_ends_s is None:
            if now_s - self._heard_s <= (LEASE_S if connected else BROKEN_LEASE_S):
                return Verdict.NOTHING
            self._doubt_ends_s = now_s + DOUBT_S
            return Verdict.ASK
        if now_s <= self._doubt_ends_s:
            return Verdict.NOTHING
        self.alive, self._doubt_ends_s = False, None
        return Verdict.GONE
