"""Runs each part of skillsets in a process of its own, and restarts what has ended."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence

RESOURCES = "resources"
RESTART_S = 0.2
CONVINCING_S = 5.0
"""A process that ends by itself within so long has something that a new start does not mend."""
END_S = 15.0
LOOK_S = 0.5
PR_SET_PDEATHSIG = 1


def own_command(words: Sequence[str]) -> list[str]:
    """Return how this process was started, with other words of the command line."""
    given = len(sys.argv) - 1
    return [sys.executable, *sys.orig_argv[1 : len(sys.orig_argv) - given], *words]


def end_with(parent: int) -> None:
    """Have this process terminated when its parent ends, however that ends (Linux, prctl)."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGTERM)


def wait_for(stop: threading.Event) -> None:
    """Wait in the main thread for what a signal's handler sets.

    A signal that comes just before the wait begins interrupts nothing, and its handler would not run before the wait ends; so
    no wait is for ever.
    """
    while not stop.wait(LOOK_S):
        pass


class Part:
    """One process that is kept alive by a thread of its own."""

    def __init__(self, name: str, command: Sequence[str], stop: threading.Event) -> None:
        self.name = name
        self.code = 0
        """What the process ended with, when it is of no use to start it again."""
        self._command = command
        self._stop = stop
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._run, name=name)

    def start(self) -> None:
        """Start the thread that keeps the process running."""
        self._thread.start()

    def end(self) -> None:
        """Ask the process to end; ``join`` waits for it."""
        with self._lock:
            self._over.set()
            if self._process is not None:
                self._process.terminate()

    def join(self) -> None:
        """Wait until the process has ended, and kill it when that takes too long."""
        self._thread.join(END_S)
        with self._lock:
            if self._process is not None:
                self._process.kill()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.is_set():
            begun_s = time.monotonic()
            code = self._once()
            if self._over.is_set():
                return
            sys.stderr.write(f"the process of {self.name} has ended ({code}); it is restarted\n")
            if code > 0 and time.monotonic() - begun_s < CONVINCING_S:
                self.code = code
                self._stop.set()
                return
            self._over.wait(RESTART_S)

    def _once(self) -> int:
        with self._lock:
            if self._over.is_set():
                return 0
            # A group of its own: a signal to the whole group of this process ends the parts through it, in order.
            self._process = subprocess.Popen([*self._command, "--parent", str(os.getpid())], start_new_session=True)
        code = self._process.wait()
        with self._lock:
            self._process = None
        return code


def supervise(skillsets: Mapping[str, Sequence[str]], words: Mapping[str, Sequence[str]], stop: threading.Event) -> int:
    """Run all parts of skillsets until ``stop``, or until one is of no use to restart; return the exit code.

    Args:
        skillsets: the names of the skills of each.
        words: of the command line of a part of each.
        stop: ends it.
    """
    resources, skills = (
        [Part(f"{skillset} {name}", own_command(["--part", name, *words[skillset]]), stop) for skillset, names in groups for name in names]
        for groups in ([(skillset, [RESOURCES]) for skillset in skillsets], skillsets.items())
    )
    for part in (*resources, *skills):
        part.start()
    wait_for(stop)
    # The skill managers first: their functions are stopped through the resource manager.
    for group in (skills, resources):
        for part in group:
            part.end()
        for part in group:
            part.join()
    return next((part.code for part in (*resources, *skills) if part.code), 0)
