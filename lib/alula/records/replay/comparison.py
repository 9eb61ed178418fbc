"""Decisions now against those of the record, one after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from alula.records.replay.recorded import Knowledge, Recorded, RecordedDecision

TOLERANCE = 1e-6
"""How far numbers of inputs may be apart, relative to the larger one, or absolute below 1."""
LATE_S = 1.0
"""How much later than in the record a decision may be made, seconds of mission clock."""


@dataclass(frozen=True)
class Difference:
    """The first decision that differs; ``then`` or ``now`` None: none was made. ``why`` names what else differs."""

    t_s: float
    then: RecordedDecision | None
    now: RecordedDecision | None
    knew_then: Knowledge = field(default_factory=Knowledge)
    knew_now: Knowledge = field(default_factory=Knowledge)
    why: str = ""

    def lines(self, zero_s: float) -> list[str]:
        """Return what a person wants to read; times count from ``zero_s``."""
        said = [f"decisions differ at {self.t_s - zero_s:.2f} s{f': {self.why}' if self.why else ''}"]
        sides = (("then", self.then, self.knew_then), ("now", self.now, self.knew_now))
        for title, decision, knew in sides if self.then is not None or self.now is not None else ():
            what = "nothing" if decision is None else f"{decision.words()} at {decision.t_s - zero_s:.2f} s"
            said.append(f"  {title + ':':5} {what}{f'   [{knew.path}]' if knew.path else ''}")
        said += [f"  {line}" for line in _apart("resource", self.knew_then.resources, self.knew_now.resources)]
        return said + [f"  {line}" for line in _apart("blackboard", self.knew_then.blackboard, self.knew_now.blackboard)]

    def as_dict(self) -> dict[str, object]:
        """Return what is written as JSON."""
        sides = ("then", self.then, self.knew_then), ("now", self.now, self.knew_now)
        told: dict[str, object] = {"t_s": self.t_s, "why": self.why}
        for title, decision, knew in sides:
            told[title] = None if decision is None else dict(vars(decision))
            told[f"knew_{title}"] = {"resources": dict(knew.resources), "blackboard": dict(knew.blackboard), "path": knew.path}
        return told


class Comparison:
    """Follows the record's decisions; ``difference`` is set at the first that differs.

    Args:
        recorded: the record.
        knowledge: what is known now, for a skill that a decision is about.
    """

    def __init__(self, recorded: Recorded, knowledge: Callable[[str], Knowledge]) -> None:
        self.difference: Difference | None = None
        self._recorded = recorded
        self._knowledge = knowledge
        self._next = 0
        self._below: tuple[float, str] | None = None

    @property
    def expected(self) -> RecordedDecision | None:
        """The decision of the record that comes next; None after the last, and after a difference."""
        decisions = self._recorded.decisions
        return decisions[self._next] if self.difference is None and self._next < len(decisions) else None

    def decided(self, now: RecordedDecision, recorded_id: str | None) -> RecordedDecision | None:
        """Take a decision; return the same one of the record, None where there is none. ``recorded_id``: of what it interrupts."""
        then = self.expected
        if then is None:
            # What is decided after the end of a record that broke off can't differ from anything.
            if self.difference is None and self._recorded.whole:
                self._differ(None, now)
            return None
        why = _apart_in(then, now, recorded_id)
        if why:
            self._differ(then, now, "" if why == "another request" else why)
            return None
        self._next += 1
        return then

    def passed(self, now_s: float) -> None:
        """Take note of the time: a decision that is not made is a difference, too."""
        then = self.expected
        if then is not None and now_s > then.t_s + LATE_S:
            self._differ(then, None)
        if self.difference is None and self._below is not None and now_s > self._below[0] + LATE_S:
            self.difference = self._made(self._below[0], None, None, self._below[1])

    def told(self, why: str, now_s: float) -> None:
        """Add a difference below the decisions; it counts unless a decision differs soon after, which shows more."""
        if self._below is None:
            self._below = now_s, why

    def over(self, now_s: float, *, whole: bool) -> None:
        """Take note that nothing more will be decided; ``whole``: what was decided then is all known."""
        then = self.expected
        if then is not None and whole:
            self.difference = self._made(now_s, then, None, "")
        elif self.difference is None and self._below is not None:
            self.difference = self._made(self._below[0], None, None, self._below[1])

    def _differ(self, then: RecordedDecision | None, now: RecordedDecision | None, why: str = "") -> None:
        t_s = now.t_s if now is not None else then.t_s if then is not None else 0.0
        self.difference = self._made(t_s, then, now, why)

    def _made(self, t_s: float, then: RecordedDecision | None, now: RecordedDecision | None, why: str) -> Difference:
        knew_then = Knowledge() if then is None else self._recorded.knowledge(then)
        about = now or then
        knew_now = self._knowledge(f"{about.skillset}.{about.skill}" if about is not None else "")
        if now is None:
            knew_now = Knowledge(knew_now.resources, knew_now.blackboard)
        return Difference(t_s, then, now, knew_then, knew_now, why)


def _apart_in(then: RecordedDecision, now: RecordedDecision, recorded_id: str | None) -> str:
    """Return what is not the same, empty where all is."""
    if (then.kind, then.skillset, then.skill) != (now.kind, now.skillset, now.skill):
        return "another request"
    if then.kind != "start" and recorded_id is not None and recorded_id != then.id:
        return "of another execution"
    names = [name for name in {**then.inputs, **now.inputs} if not alike(then.inputs.get(name), now.inputs.get(name))]
    return f"input {', '.join(names)}" if names else ""


def alike(one: Any, other: Any) -> bool:
    """Return whether two values are the same, numbers within the tolerance."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(alike(one[name], other[name]) for name in one)
    if isinstance(one, Sequence) and isinstance(other, Sequence) and not isinstance(one, str) and not isinstance(other, str):
        return len(one) == len(other) and all(alike(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    return bool(one == other)


def _apart(what: str, then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    names = sorted(name for name in {**then, **now} if not alike(then.get(name), now.get(name)))
    return [f"{what} {name}: then {then.get(name)!r}, now {now.get(name)!r}" for name in names if name in then and name in now]
