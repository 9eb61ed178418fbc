"""Threads for hooks: no hook waits for another one to return, and a hook that never returns does not keep the process alive."""

from __future__ import annotations

import queue
import threading
import time
import traceback
from collections.abc import Callable

from alula.runtime.timers import Job

IDLE_S = 10.0
"""A thread without work for so long ends."""


class Workers:
    """Runs each job at once, on a thread that has nothing to do or on a new one; ``on_error`` gets what a job raises."""

    def __init__(self, name: str, on_error: Callable[[str], object]) -> None:
        self._name = name
        self._on_error = on_error
        self._jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._changed = threading.Condition()
        self._open = 0
        self._threads = 0

    def submit(self, job: Job) -> None:
        """Run a job on a thread that is free, else on a new one; returns at once."""
        with self._changed:
            self._open += 1
            new = self._open > self._threads
            if new:
                self._threads += 1
        self._jobs.put(job)
        if new:
            threading.Thread(target=self._work, name=self._name, daemon=True).start()

    def close(self, timeout_s: float) -> bool:
        """Wait (wall clock) until all jobs are done; False when they aren't within the time."""
        end = time.monotonic() + timeout_s
        with self._changed:
            return self._changed.wait_for(lambda: self._open == 0, max(0.0, end - time.monotonic()))

    def _work(self) -> None:
        while True:
            try:
                job = self._jobs.get(timeout=IDLE_S)
            except queue.Empty:
                if self._retire():
                    return
                continue
            try:
                job()
            except BaseException as error:  # noqa: BLE001 - told; the thread is for the next job
                self._on_error("".join(traceback.format_exception(error)))
            with self._changed:
                self._open -= 1
                self._changed.notify_all()

    def _retire(self) -> bool:
        """Be counted off, unless a job is there that counts on this thread."""
        with self._changed:
            if self._open >= self._threads:
                return False
            self._threads -= 1
            return True
