"""Where a rampage takes place: the managers of the drone's navigation with random hooks, and clients of them."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any, Protocol

from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula.common.shared_memory import sweep_shared_memory
from alula.runtime.local import LocalManagers, LocalWorld
from alula_testing.attacks.graph import TIMEOUT_S, LiveGraph
from alula_testing.attacks.hooks import random_hooks
from alula_testing.navigation import FLYING
from alula_testing.ros1 import end_process

LOOK_S = 0.02
TAIL_LINES = 40
FAILURES = ("the listener raised", "Fatal Python error", "terminate called", "Segmentation fault", "InvalidHandle")
"""What managers log when they could not do their own work, whatever their hooks do."""


class Stage(Protocol):
    """A world with managers that can be killed, and perhaps frozen."""

    clients: list[Any]

    def rest(self, seconds: float) -> None:
        """Let time pass."""
        ...

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait until a condition holds, so long at most; tell whether it does."""
        ...

    def kill(self) -> None:
        """Kill the managers, and start others that fly."""
        ...

    def freeze(self, seconds: float) -> None:
        """Let the managers stand still for so long, without effect where nothing can."""
        ...

    def close(self) -> dict[str, Any]:
        """End the managers, and return what there is to say of them."""
        ...


class LocalStage:
    """Virtual time."""

    def __init__(self, clients: int, chance: random.Random) -> None:
        self._world = LocalWorld(latency_s=0.01)
        self._chance = chance
        self._errors: list[str] = []
        self._managers = self._serve()
        self.clients = [self._world.client(SKILLSET.name) for _ in range(clients)]
        self._world.run_for(1.0)

    def rest(self, seconds: float) -> None:
        """Let virtual time pass."""
        self._world.run_for(seconds)

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Let virtual time pass until a condition holds."""
        return self._world.run_until(condition, timeout_s=seconds)

    def kill(self) -> None:
        """Kill the managers."""
        self._errors += self._managers.errors
        self._world.kill(SKILLSET.name)
        self._world.run_for(self._chance.uniform(0.0, 2.0))
        self._managers = self._serve()
        self._world.run_for(1.0)

    def freeze(self, seconds: float) -> None:
        """Do nothing: in one process all stand still together."""

    def close(self) -> dict[str, Any]:
        """Return what the managers could not do."""
        self._errors += self._managers.errors
        return {"not done": [error for error in self._errors if any(word in error for word in FAILURES)]}

    def _serve(self) -> LocalManagers:
        managers = self._world.serve(SKILLSET, lambda managers: random_hooks(ABSTRACT_HOOKS, managers.after, self._chance))
        for resource, state in FLYING.items():
            managers.transition(resource, state)
        return managers


class LiveStage:
    """Managers in a process over a ROS, clients in this one."""

    def __init__(self, graph: LiveGraph, clients: int, chance: random.Random) -> None:
        self._graph = graph
        self._chance = chance
        self._log: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115 - closed with the stage
        self._deaths: list[str] = []
        self._threads: list[int] = []
        sweep_shared_memory()
        self._managers = self._serve()
        self.clients = [graph.make_client() for _ in range(clients)]
        self._fly()

    def rest(self, seconds: float) -> None:
        """Let time pass, and see that the managers live."""
        time.sleep(seconds)
        if self._managers.poll() is not None:
            self._deaths.append(f"ended with {self._managers.returncode}")
            self._restart()

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait (wall clock) until a condition holds."""
        end_s = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end_s:
                return False
            self.rest(LOOK_S)
        return True

    def kill(self) -> None:
        """Kill the managers, and start others."""
        self._threads.append(threads_of(self._managers.pid))
        os.killpg(self._managers.pid, signal.SIGKILL)
        self._managers.wait()
        self._restart()

    def freeze(self, seconds: float) -> None:
        """Freeze the process of the managers."""
        os.kill(self._managers.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(self._managers.pid, signal.SIGCONT)

    def close(self) -> dict[str, Any]:
        """End the managers politely."""
        self._threads.append(threads_of(self._managers.pid))
        self._managers.send_signal(signal.SIGTERM)
        try:
            code: int | str = self._managers.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._managers.kill()
            code = "hangs"
        self._log.seek(0)
        said = failures_in(self._log)
        self._log.close()
        return {
            "not done": said[:20],
            "died": self._deaths,
            "exit code": code,
            "threads of managers": dict(sorted(Counter(self._threads).items())),
            "dead segments of shared memory": sweep_shared_memory(),
        }

    def end(self) -> None:
        """See that nothing is left, however the rampage went."""
        end_process(self._managers)  # type: ignore[arg-type]  # of text or bytes, it is ended

    def _restart(self) -> None:
        self._managers = self._serve()
        self._fly()

    def _serve(self) -> subprocess.Popen[str]:
        managers = self._graph.start("server", str(self._chance.randrange(2**31)), log=self._log)  # type: ignore[arg-type]
        assert self._graph.read_until_ready(managers), f"the managers do not start: {managers.wait(TIMEOUT_S)}\n{self._tail()}"
        return managers

    def _tail(self) -> str:
        """Return what managers have logged last."""
        self._log.seek(0)
        return "".join(deque(self._log, TAIL_LINES))

    def _fly(self) -> None:
        found = self.until(lambda: all(client.ready for client in self.clients), TIMEOUT_S)
        assert found, f"clients do not find the managers: {[what_is_known(client) for client in self.clients if not client.ready]}"
        for resource, state in FLYING.items():
            assert self.until(lambda r=resource, s=state: self._taken(r, s), TIMEOUT_S), f"{resource} does not get {state}"  # type: ignore[misc]

    def _taken(self, resource: str, state: str) -> bool:
        """Take a transition; a client that has just doubted slow managers is asked again."""
        asked = self.clients[0].transition(resource, state)
        return bool(asked.wait(TIMEOUT_S)) and not asked.failure


def failures_in(log: Iterable[str]) -> list[str]:
    """Return the lines of a log that tell of a failure, each traceback's error beside its beginning."""
    found: list[str] = []
    inside = False
    for line in log:
        if any(word in line for word in FAILURES):
            found.append(line.strip())
            inside = "Traceback" in line
        elif inside and line.strip() and not line[0].isspace():
            found[-1] += f" ... {line.strip()}"
            inside = False
    return found


def what_is_known(client: Any) -> dict[str, object]:
    """Return why a client is not ready."""
    connection = client._connection
    known = {name: value for name, value in vars(connection).items() if isinstance(value, bool | str)}
    missing = [name for name, link in connection.links.items() if not link.connected]
    return known | {"not connected": missing, "not subscribed": sum(not connected() for connected in connection.subscriptions)}


def threads_of(pid: int) -> int:
    """Return how many threads a process has; 0 when it has ended."""
    tasks = Path(f"/proc/{pid}/task")
    return len(list(tasks.iterdir())) if tasks.exists() else 0
