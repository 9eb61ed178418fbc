"""Questions to the managers, asked on threads of their own: each gets its answer, or the reason why there is none, in time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from skill_runtime.waiting import Host, Pending
from skillset_ros1.calls import call

PATIENCE_S = 5.0
HOOK_PATIENCE_S = 15.0
"""For what a hook has to answer: longer than the managers wait for it."""


class Questions:
    """The services of one skillset as its client calls them."""

    def __init__(self, place: str, host: Host) -> None:
        self._place = place
        self._host = host
        self._open: WeakSet[Pending[Any]] = WeakSet()

    def ask(self, service: str, kind: Any, request: Any, settle: Callable[[Any], Any], *, patience_s: float = PATIENCE_S) -> Pending[Any]:
        """Ask; ``settle(response)`` makes the answer. Never waits."""
        pending = self.moment()
        call(f"{self._place}/{service}", kind, request, lambda r: pending.resolve(settle(r)), pending.fail, timeout_s=patience_s)
        return pending

    def moment(self) -> Pending[Any]:
        """Return an answer that nobody has given yet."""
        pending: Pending[Any] = Pending(self._host)
        self._open.add(pending)
        return pending

    def give_up(self, reason: str) -> None:
        """End all without an answer."""
        for pending in list(self._open):
            pending.fail(reason)
