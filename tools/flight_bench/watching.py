"""One flight, started as a user starts it and watched through ``/proc``: the processor time of each process, in each phase."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from alula.common.processes import command_line, node_name
from alula.common.record import EVENTS, FILE, RecordFollower
from alula.records.run import departure

START, FLIGHT, REPORT = PHASES = ("start", "flight", "report")
"""Until the robot departs; until the processes of the run have ended; until the command has."""
LOOK_S = 0.2
"""Wall clock between two looks."""
FRONT, SUPERVISOR, UNSEEN = "front, report", "supervisor", "too short to be seen"
KNOWN = {"alula_flight.supervisor": SUPERVISOR, "rosmaster": "ROS 1 master"}
"""Processes that roslaunch gives no name, by a word of their command line."""
Cost = Mapping[str, Mapping[str, float]]
"""Seconds of processor time by process and phase."""


@dataclass(frozen=True)
class Watched:
    """What a command took. ``wall_s`` by phase; ``memory_mb``: the largest resident size of each process."""

    code: int
    cpu_s: Cost
    wall_s: Mapping[str, float]
    memory_mb: Mapping[str, float]


@dataclass
class _Seen:
    name: str = ""
    cpu_s: float = 0.0


@dataclass
class Tally:
    """Sums up what the processes of a tree take: each its own time, and what ended between two looks, as its parent was told of it."""

    cpu_s: dict[str, dict[str, float]] = field(default_factory=lambda: defaultdict(lambda: dict.fromkeys(PHASES, 0.0)))
    memory_mb: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _seen: dict[tuple[int, float], _Seen] = field(default_factory=dict)
    _whole_s: float = 0.0

    def look(self, root: psutil.Process, phase: str) -> set[str]:
        """Add what each process has taken since the last look; return the names of those that live."""
        names = {root.pid: FRONT}
        told_s = known_s = 0.0
        for process in tree_of(root):
            with contextlib.suppress(psutil.Error):  # it has ended meanwhile
                name = names[process.pid] = names.get(process.pid) or name_of(process) or names.get(process.ppid(), FRONT)
                times, seen = process.cpu_times(), self._seen.setdefault((process.pid, process.create_time()), _Seen())
                own_s = times.user + times.system
                self.cpu_s[name][phase] += own_s - seen.cpu_s
                self.memory_mb[name] = max(self.memory_mb[name], process.memory_info().rss / 1e6)
                known_s += own_s - seen.cpu_s
                told_s += own_s + times.children_user + times.children_system
                seen.name, seen.cpu_s = name, own_s
        self._note_unseen(told_s, known_s, phase)
        return set(names.values())

    def close(self, whole_s: float) -> None:
        """Take what the kernel says of the whole tree, now that it has ended."""
        self._note_unseen(whole_s, 0.0, REPORT)

    def _note_unseen(self, told_s: float, known_s: float, phase: str) -> None:
        """Note what has ended since the last look. A process that has not been waited for yet is told of by a later look."""
        unseen_s = told_s - self._whole_s - known_s
        if unseen_s > 0.0:
            self.cpu_s[UNSEEN][phase] += unseen_s
            known_s += unseen_s
        self._whole_s += known_s


def tree_of(root: psutil.Process) -> list[psutil.Process]:
    """Return a process and all that descend from it, parents first."""
    try:
        return [root, *root.children(recursive=True)]
    except psutil.Error:  # it has just ended
        return [root]


def name_of(process: psutil.Process) -> str:
    """Return what roslaunch, or this table, calls a process; empty for what another one has started for itself."""
    words = command_line(process)
    known = (name for word, name in KNOWN.items() if any(word in one for one in words))
    return next(known, "") or node_name(process)


class Phases:
    """Follows a run's folder and processes: which phase it is in."""

    def __init__(self, out: Path) -> None:
        self._record, self._place = RecordFollower(out / FILE), departure()
        self._now = START
        self._supervised = False

    def look(self, names: set[str]) -> str:
        """Return the phase, with what lives now."""
        self._supervised = self._supervised or SUPERVISOR in names
        if self._now == START and self._departed():
            self._now = FLIGHT
        if self._supervised and SUPERVISOR not in names:
            self._now = REPORT
        return self._now

    def _departed(self) -> bool:
        events = (entry.value for entry in self._record.poll() if entry.topic == EVENTS)
        return any(self._place is None or (event.get("resource"), event.get("from_state")) == self._place for event in events)


def watch(command: Sequence[str], out: Path, log: Path, environment: Mapping[str, str] | None = None) -> Watched:
    """Run a command that makes a run in ``out`` to its end; what it prints goes to ``log``."""
    tally, phases, wall_s = Tally(), Phases(out), dict.fromkeys(PHASES, 0.0)
    with log.open("wb") as words:
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=words, stderr=subprocess.STDOUT, env=environment)
    root, phase, since_s = psutil.Process(child.pid), START, time.monotonic()
    while os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        phase = phases.look(tally.look(root, phase))
        time.sleep(LOOK_S)
        wall_s[phase] += time.monotonic() - since_s
        since_s = time.monotonic()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    tally.close(usage.ru_utime + usage.ru_stime)
    return Watched(child.returncode, {name: dict(row) for name, row in tally.cpu_s.items()}, wall_s, dict(tally.memory_mb))
