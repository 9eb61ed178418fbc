"""The state of a deployment's parts as a file, which tells them also after a crash; and the locks of keeper and mission."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TextIO

import psutil

from alula.common.files import write_json

FILE, KEEPER_LOCK, MISSION_LOCK, WANTED = "state.json", "keeper.lock", "mission.lock", "wanted.json"
STARTING, RUNNING, WAITING, REFUSED, GIVEN_UP, ENDED = "starting", "running", "waiting", "refused", "given up", "ended"
"""Of a part: has it lived for a moment; is it started again soon; does it say itself that it can't; has it died too often; was it ended."""
BOOT = Path("/proc/sys/kernel/random/boot_id")
TICKS_A_SECOND = os.sysconf("SC_CLK_TCK")


@dataclass
class PartState:
    """A part: its process, and what became of earlier ones.

    Attributes:
        pid: of its process; 0: it has none.
        start: which start of a process with this id that was, see `start_of`; process ids are used again.
        state: one of the words above.
        words: its command.
        graph: what its environment says of the graph.
        contents: digests of its models, bindings and hooks, by their names.
        deaths: how often it has ended without being told to.
        why: how it ended last, or why it can't run.
    """

    pid: int = 0
    start: str = ""
    state: str = STARTING
    words: tuple[str, ...] = ()
    graph: Mapping[str, str] = field(default_factory=dict)
    contents: Mapping[str, str] = field(default_factory=dict)
    deaths: int = 0
    why: str = ""

    @property
    def process(self) -> psutil.Process | None:
        """Return its process where that lives, and is the one that was started."""
        return living(self.pid, self.start)


@dataclass
class StationState:
    """All parts of a deployment by their names, in the order of the start.

    Attributes:
        run_id: what their processes carry in their environment.
        keeper: process id of what keeps them up; ``keeper_start``: which start of it that was.
        answered: the number of the last request that the keeper has done.
        disk: what is to be said of the disk; empty: nothing.
        master: of the ROS 1 master, see `MasterWatch.told`.
    """

    run_id: str = ""
    keeper: int = 0
    keeper_start: str = ""
    answered: int = 0
    disk: str = ""
    parts: dict[str, PartState] = field(default_factory=dict)
    master: Mapping[str, object] = field(default_factory=dict)

    def save(self, folder: Path) -> None:
        """Write it in one step; a full disk ends nothing."""
        try:
            write_json(folder / FILE, asdict(self))
        except OSError as error:
            self.disk = f"the state can't be written: {error.strerror}"

    @classmethod
    def load(cls, folder: Path) -> StationState:
        """Read it; an empty one where there is none, or it is none."""
        try:
            said = json.loads((folder / FILE).read_text(encoding="utf-8"))
            parts = {name: PartState(**{**one, "words": tuple(one["words"])}) for name, one in said.pop("parts").items()}
            return cls(**said, parts=parts)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return cls()


def start_of(pid: int) -> str:
    """Return which start of a process with this id the present one is: the boot, and the kernel's ticks from there; "" where it is gone.

    The wall clock, by which psutil tells it, may be set while the process lives.
    """
    try:
        ticks = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[19]  # proc(5): starttime
        return f"{BOOT.read_text(encoding='ascii').strip()} {ticks}"
    except (OSError, IndexError):
        return ""


def lasting_s(start: str) -> float:
    """Return how long ago a start of this boot was."""
    return max(0.0, time.clock_gettime(time.CLOCK_BOOTTIME) - int(start.split()[1]) / TICKS_A_SECOND)


def living(pid: int, start: str) -> psutil.Process | None:
    """Return a process that lives and is of that start."""
    try:
        process = psutil.Process(pid) if pid and start and start_of(pid) == start else None
        return process if process is not None and process.status() != psutil.STATUS_ZOMBIE else None
    except psutil.Error:
        return None


def take(path: Path) -> TextIO | None:
    """Take a lock, which the kernel gives back when this process ends, however it ends; None where another process has it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file = path.open("a+", encoding="utf-8")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    return file


def note_holder(lock: TextIO, what: str) -> None:
    """Write into a lock that was taken what holds it."""
    lock.truncate(0)
    lock.write(f"{what}, process {os.getpid()}\n")
    lock.flush()


def holder(path: Path) -> str:
    """Return what holds a lock, in words; empty: nobody does."""
    if not path.exists():
        return ""
    lock = take(path)
    if lock is not None:
        lock.close()
        return ""
    return path.read_text(encoding="utf-8", errors="replace").strip() or "another process"
