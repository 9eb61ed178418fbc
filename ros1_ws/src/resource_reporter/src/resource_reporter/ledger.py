"""Desired against actual states of one skillset's resources, and which transition to request next. No ROS, no threads, no clock."""

from __future__ import annotations

from dataclasses import dataclass, field

FIRST_RETRY_S = 0.025
LONGEST_RETRY_S = 0.2


@dataclass(frozen=True)
class Call:
    """One call of the skillset's transition service."""

    resource: str
    to: str
    reason: str = field(default="", compare=False)
    """Why the resource is so, in words."""


@dataclass
class _Entry:
    """What is wanted of one resource, and when it may be asked for."""

    state: str
    reason: str = ""
    insist: bool = True
    not_before_s: float = 0.0
    retry_s: float = FIRST_RETRY_S
    answered: bool = False
    """The skillset has accepted or refused this state: it knows."""

    def put_off(self, now_s: float) -> None:
        """Ask again later: 25 ms after the first attempt, then twice as long each time, at most 0.2 s."""
        self.not_before_s = now_s + self.retry_s
        self.retry_s = min(2.0 * self.retry_s, LONGEST_RETRY_S)


@dataclass
class Ledger:
    """Keeps the hardware's states beside those that the skillset shows. Times are seconds of any clock that only grows.

    Level-triggered: only the last wanted state of a resource counts, and it is asked for again whenever the skillset shows another,
    for instance because it was restarted. Before the skillset has shown its states nothing is asked. Only what it shows counts as
    its state: an answer comes over another connection, and may be older than the last state shown.
    """

    _wanted: dict[str, _Entry] = field(default_factory=dict)
    _actual: dict[str, str] = field(default_factory=dict)
    _reasons: dict[str, str] = field(default_factory=dict)
    """Those that the skillset shows."""
    _told: set[tuple[Call, str]] = field(default_factory=set)

    def want(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> bool:
        """Store the state that the hardware has, and why; return whether this is news. Without ``insist``, see ``ResourceReporter``."""
        entry = self._wanted.get(resource)
        if entry is None or (entry.state, entry.insist) != (state, insist):
            self._wanted[resource] = _Entry(state, reason, insist)
            return True
        # A reason that changes often must not be reported more often than calls are repeated.
        news, entry.reason = entry.reason != reason, reason
        return news

    def observe(self, states: dict[str, str], reasons: dict[str, str] | None = None) -> None:
        """Store the states that the skillset shows (all of its resources), and the reasons. A changed one may be requested at once."""
        for resource, entry in self._wanted.items():
            before, after = self._actual.get(resource), states.get(resource)
            if before not in {after, entry.state}:
                entry.not_before_s = 0.0
            if before == entry.state != after:  # restarted, for instance: what it knew is gone
                entry.answered = False
        self._actual, self._reasons = dict(states), dict(reasons or {})

    def next_call(self, now_s: float) -> Call | None:
        """Return the transition to request now, the longest waiting first; None if all agree or must wait."""
        due = [(entry.not_before_s, name) for name, entry in self._wanted.items() if self._differs(name) and entry.not_before_s <= now_s]
        if not due:
            return None
        name = min(due, key=lambda item: item[0])[1]
        return Call(name, self._wanted[name].state, self._wanted[name].reason)

    def wait_s(self, now_s: float) -> float | None:
        """Return for how many seconds nothing is due; None: until the hardware or the skillset has a new state."""
        times = [entry.not_before_s for name, entry in self._wanted.items() if self._differs(name)]
        return max(0.0, min(times) - now_s) if times else None

    @property
    def settled(self) -> bool:
        """Return whether the skillset has every reported state: it shows it, or has accepted or refused it."""
        return all(self._known(name, entry) for name, entry in self._wanted.items())

    def reached(self, call: Call, now_s: float) -> None:
        """Record an answer by which the resource has the requested state; the skillset gets the longest wait to show it."""
        entry = self._asked_for(call)
        if entry is not None:
            entry.answered = True
            entry.not_before_s = now_s + LONGEST_RETRY_S

    def refused(self, call: Call, reason: str, now_s: float, *, answered: bool = True) -> bool:
        """Record a refusal, to be tried again; return whether this (call, reason) is reported for the first time.

        Args:
            call: what was requested.
            reason: why it was refused, in words.
            now_s: when.
            answered: False where the call failed, so that the skillset may not have received it.
        """
        entry = self._asked_for(call)
        if entry is not None:
            entry.answered |= answered
            entry.put_off(now_s)
        first = (call, reason) not in self._told
        self._told.add((call, reason))
        return first

    @property
    def wanted(self) -> dict[str, str]:
        """Return the state that the hardware has of each resource."""
        return {name: entry.state for name, entry in self._wanted.items()}

    def unknown(self) -> list[str]:
        """Return the wanted resources that the skillset, which has shown its states, does not have."""
        return [name for name in self._wanted if self._actual and name not in self._actual]

    def _asked_for(self, call: Call) -> _Entry | None:
        """Return what a call was for, if that is still wanted."""
        entry = self._wanted.get(call.resource)
        return entry if entry is not None and entry.state == call.to else None

    def _known(self, resource: str, entry: _Entry) -> bool:
        if not self._actual:
            return False
        return entry.answered or not entry.insist or self._actual.get(resource, entry.state) == entry.state

    def _differs(self, resource: str) -> bool:
        """Return whether the skillset shows another state than the hardware has, or another reason than is known."""
        if resource not in self._actual:
            return False
        wanted = self._wanted[resource]
        if self._actual[resource] != wanted.state:
            return wanted.insist
        return bool(wanted.reason) and self._reasons.get(resource) != wanted.reason
