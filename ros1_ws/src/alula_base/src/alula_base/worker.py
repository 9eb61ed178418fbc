"""A thread for each call: one that hangs, or waits for its time, delays no other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import rospy

from alula_base.calls import Silent, StopCall
from alula_base.clock import now_s
from resource_reporter import CallFailedError


@dataclass(frozen=True)
class Outcome:
    """The outcome of a call.

    Attributes:
        done: whether it did what it is for; None: it is under way, or was not called yet.
        said: in words.
        took_s: how long it took, wall clock.
    """

    done: bool | None = None
    said: str = ""
    took_s: float = 0.0


LOOK_S = 0.05
"""Wall clock; how often a call that waits looks whether its time has come, or there is a heartbeat again."""


class Worker:
    """Runs a call when it is wanted; when it is wanted while it runs, once more afterwards.

    Args:
        name: of the call.
        call: what is called.
        after_s: the silence has to last for so long after the call was wanted.
        silent: tells whether it lasts.
        on_change: called from the worker's thread when the outcome is known.
    """

    def __init__(self, name: str, call: StopCall, after_s: float, silent: Silent, on_change: Callable[[], None]) -> None:
        self.outcome = Outcome()
        self._name, self._call, self._after_s = name, call, after_s
        self._silent, self._on_change = silent, on_change
        self._wanted = threading.Event()
        threading.Thread(target=self._work, name=f"stop_{name}", daemon=True).start()

    @property
    def when(self) -> str:
        """Return when the call is made, in words; "": at once."""
        return f" after {self._after_s:g} s more" if self._after_s else ""

    def want(self) -> None:
        """Request the call; return at once."""
        self._wanted.set()

    def _work(self) -> None:
        while True:
            self._wanted.wait()
            self._wanted.clear()
            if not self._is_due():
                self.outcome = Outcome(None, f"was not called: heard again within {self._after_s:g} s")
                self._on_change()
                continue
            self.outcome = Outcome(None, "is called")
            self.outcome = self._made()
            (rospy.logwarn if self.outcome.done else rospy.logerr)("%s: %s", self._name, self.outcome.said)
            self._on_change()

    def _is_due(self) -> bool:
        """Wait for the time of the call; return whether the silence has lasted until then."""
        if not self._after_s:
            return True
        self.outcome = Outcome(None, f"is called if nothing is heard for {self._after_s:g} s more")
        end_s = now_s() + self._after_s
        while self._silent():
            if now_s() >= end_s:
                return True
            time.sleep(LOOK_S)
        return False

    def _made(self) -> Outcome:
        begin_s = time.monotonic()
        try:
            done, said = True, self._call.run(self._silent)
        except CallFailedError as error:
            done, said = False, str(error)
        except Exception as error:  # noqa: BLE001 -- whatever it is, the call can be made again, and the others are made
            done, said = False, f"{type(error).__name__}: {error}"
        return Outcome(done, said, time.monotonic() - begin_s)
