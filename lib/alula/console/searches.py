"""What could have been done about a fault of a run: searches by `alula repair`, each a process, of which viewers see how far it is."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

from alula.common.robots import RobotFolder
from alula.common.scenarios import load_scenario
from alula.console.acts import end
from alula.console.link import ActError
from alula.runtime.live.options import entry

COMMAND = "alula repair: "
NICE = 10
"""What else runs on this computer comes first."""
_FAULT = re.compile(r"[a-z][A-Za-z0-9_]{0,60}")


@dataclass(frozen=True)
class Found:
    """The progress of a search, and its answer.

    Attributes:
        says: the last line of its progress.
        answer: what it has found, as text; None while it goes on.
    """

    says: str = ""
    answer: str | None = None


@dataclass
class _Search:
    process: subprocess.Popen[bytes]
    output: IO[bytes]
    found: Found = field(default_factory=Found)

    def follow(self) -> None:
        """Take note of the progress, to the end."""
        with self.output, self.process:
            for line in self.process.stderr or ():
                self.found = Found(line.decode(errors="replace").strip().removeprefix(COMMAND))
            self.process.wait()
            self.output.seek(0)
            answer = self.output.read().decode(errors="replace").strip()
            self.found = replace(self.found, answer=answer or self.found.says or f"it ended with {self.process.returncode}")


class Searches:
    """The searches for runs, at most one at a time: each takes a core."""

    def __init__(self) -> None:
        self._known: dict[tuple[Path, str], _Search] = {}
        self._lock = threading.Lock()

    def start(self, run: Path, fault: str, words: Sequence[str]) -> None:
        """Start a search for a run's fault; raises ActError where another one goes on."""
        with self._lock:
            going = next((name for (_, name), one in self._known.items() if one.found.answer is None), None)
            if going is not None:
                raise ActError(f"a search goes on, for {going}; stop it, or wait for its answer")
            output = tempfile.TemporaryFile()  # noqa: SIM115 - whoever follows the search closes it
            process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.PIPE, start_new_session=True)
            with contextlib.suppress(ProcessLookupError):
                os.setpriority(os.PRIO_PGRP, process.pid, NICE)
            search = self._known[run, fault] = _Search(process, output)
        threading.Thread(target=search.follow, name=f"search for {fault}", daemon=True).start()

    def stop(self, run: Path, fault: str) -> None:
        """Have a search end with the best so far; raises ActError where none goes on."""
        search = self._known.get((run, fault))
        if search is None or search.found.answer is not None:
            raise ActError(f"no search goes on for {fault}")
        with contextlib.suppress(ProcessLookupError):
            os.killpg(search.process.pid, signal.SIGINT)

    def found(self, run: Path) -> dict[str, Found]:
        """Return what is known of the searches for a run, by their faults."""
        return {fault: one.found for (path, fault), one in tuple(self._known.items()) if path == run}

    def close(self) -> None:
        """End them all."""
        for one in self._known.values():
            if one.found.answer is None:
                end(one.process)


def words_for(robot: RobotFolder, scenario: str, fault: object) -> list[str]:
    """Return the command that answers a fault of a run; raises ActError, ScenarioError."""
    if not isinstance(fault, str) or not _FAULT.fullmatch(fault):
        raise ActError(f"{fault!r} is no fault")
    mission = load_scenario(scenario, robot.scenarios).mission
    if not mission.endswith(".xml"):
        raise ActError(f"the scenario {scenario} has no mission in a file")
    return [entry(), "--robot", str(robot.root), "repair", str(robot.root / mission), "--fault", fault]
