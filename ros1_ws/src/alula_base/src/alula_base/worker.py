"""A thread for each call: one that hangs delays no other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import rospy

from alula_base.calls import Silent, StopCall
from resource_reporter import CallFailedError


@dataclass(frozen=True)
class Outcome:
    """What became of a call.

    Attributes:
        done: whether it did what it is for; None: it is under way, or was not called yet.
        said: in words.
        took_s: how long it took, wall clock.
    """

    done: bool | None = None
    said: str = ""
    took_s: float = 0.0


class Worker:
    """Runs a call when it is wanted; when it is wanted while it runs, once more afterwards.

    ``on_change`` is called from the worker's thread.
    """

    def __init__(self, name: str, call: StopCall, silent: Silent, on_change: Callable[[], None]) -> None:
        self.outcome = Outcome()
        self._name, self._call = name, call
        self._silent, self._on_change = silent, on_change
        self._wanted = threading.Event()
        threading.Thread(target=self._work, name=f"stop_{name}", daemon=True).start()

    def want(self) -> None:
        """Have the call made; returns at once."""
        self._wanted.set()

    def _work(self) -> None:
        while True:
            self._wanted.wait()
            self._wanted.clear()
            self.outcome = Outcome(None, "is called")
            self.outcome = self._made()
            (rospy.logwarn if self.outcome.done else rospy.logerr)("%s: %s", self._name, self.outcome.said)
            self._on_change()

    def _made(self) -> Outcome:
        begin_s = time.monotonic()
        try:
            done, said = True, self._call.run(self._silent)
        except CallFailedError as error:
            done, said = False, str(error)
        except Exception as error:  # noqa: BLE001 -- whatever it is, the call can be made again, and the others are made
            done, said = False, f"{type(error).__name__}: {error}"
        return Outcome(done, said, time.monotonic() - begin_s)
