"""How one waits where time is virtual: by letting the world run."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from skill_runtime.local.clock import WorldError
from skill_runtime.waiting import CannotWaitError

if TYPE_CHECKING:
    from skill_runtime.local.world import LocalWorld

FOREVER_S = 1e9


class LocalHost:
    """Waits by letting virtual time pass; times are seconds of mission clock."""

    def __init__(self, world: LocalWorld) -> None:
        self._world = world

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Let the world run until the event; None: until it comes or nothing can happen any more.

        Raises:
            CannotWaitError: from inside a job of the world, which would wait for itself; or the event can't come any more.
        """
        try:
            if timeout_s is not None:
                return self._world.run_until(event.is_set, timeout_s=timeout_s)
            self._world.run_until(lambda: event.is_set() or self._world.clock.idle, timeout_s=FOREVER_S)
        except WorldError as error:
            raise CannotWaitError(str(error)) from error
        if not event.is_set():
            raise CannotWaitError("nothing can happen in this world any more, so what is waited for will not come")
        return True
