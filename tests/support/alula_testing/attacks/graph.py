"""What an attack needs of a world: managers, clients and a way to wait."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import IO, Any, Protocol

from alula_testing import waits
from alula_testing.ros1 import end_process

TIMEOUT_S = 120.0
READY = "serving"


class Graph(Protocol):
    """One world with the managers of the drone's navigation, whose functions run until they are ended."""

    def client(self) -> Any:
        """Return a client of the skillset that is ready."""
        ...

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait until the condition holds; fail, naming ``what``, when it does not within a generous time."""
        ...


class LiveGraph:
    """A world with processes: managers can be frozen and started twice, clients can end without a word."""

    def __init__(self, world: str, make_client: Callable[[], Any]) -> None:
        self._world = world
        self.make_client = make_client
        self._client: Any = None
        self._managers: subprocess.Popen[str] | None = None

    @property
    def managers(self) -> subprocess.Popen[str]:
        """The process of the managers; started when it is first needed."""
        if self._managers is None:
            self._managers = self.start("server")
            self.read_until_ready(self._managers)
        return self._managers

    def client(self) -> Any:
        """Return the one client of this process, ready."""
        assert self.managers.poll() is None, "the managers have ended"
        if self._client is None:
            self._client = self.make_client()
        assert self._client.wait_ready(TIMEOUT_S), "the managers are not there"
        return self._client

    def until(self, condition: Callable[[], object], what: str, timeout_s: float = TIMEOUT_S) -> None:
        """Wait until the condition holds (wall clock)."""
        waits.until(condition, what, timeout_s)

    def start(self, program: str, *words: str, log: IO[str] | int = subprocess.PIPE) -> subprocess.Popen[str]:
        """Start a program of this package in this world; what it says on stderr goes to ``log``."""
        command = [sys.executable, "-m", f"alula_testing.attacks.{program}", self._world, *words]
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": log}
        return subprocess.Popen(command, text=True, start_new_session=True, env=os.environ.copy(), **pipes)

    @staticmethod
    def read_until_ready(process: subprocess.Popen[str]) -> bool:
        """Return True as soon as the managers of a process serve, False when it has ended instead."""
        assert process.stdout is not None
        return any(line.strip() == READY for line in process.stdout)

    def close(self) -> None:
        """End the managers."""
        if self._managers is not None:
            end_process(self._managers)  # type: ignore[arg-type]  # of text or bytes, it is ended


def answer(found: dict[str, Any]) -> str:
    """Return what an attack has found as a line."""
    return json.dumps(found) + "\n"
