"""The runs of a fleet's robots beside the run of its mission: each serves its skills in the same DDS domain until the mission is over."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from alula.common.processes import die_with_parent, end_run
from alula.common.robots import find_robot
from alula.report.deaths import Death, describe_exit, note_death
from alula.runtime.live.options import entry
from alula.runtime.live.spec import FILE, RunSpec

LOOK_S = 0.1
END_TIMEOUT_S = 300.0  # wall clock, for the robots to come to rest, and for their reports


class Member:
    """The run of one robot: ``alula run`` as a process of its own, whose words are in ``logs/NAME.log`` of the fleet's run."""

    def __init__(self, spec: RunSpec, name: str, robot: Path, words: Sequence[str]) -> None:
        self.name = name
        self.folder = Path(spec.out_dir) / name
        self._log = Path(spec.out_dir) / "logs" / f"{name}.log"
        place = ["--namespace", name, "--domain", str(spec.domain), "--seed", str(spec.seed), "--out", str(self.folder)]
        self._command = [entry(), "--robot", str(robot), "run", *words, "--commanded", *place]
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it in a session of its own, so that a Ctrl-C does not reach it; it ends in order when this process dies."""
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=die_with_parent,  # noqa: PLW1509  (one prctl, no allocation)
            )

    @property
    def lives(self) -> bool:
        """Return whether it was started, and has not ended."""
        return self.process is not None and self.process.poll() is None

    @property
    def has_begun(self) -> bool:
        """Return whether it starts its robot: it refuses nothing any more of what it is asked."""
        return (self.folder / FILE).exists()

    @property
    def last_words(self) -> str:
        """Return the last line that it has said."""
        lines = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines() if self._log.exists() else []
        return lines[-1].removeprefix("alula run: ") if lines else "it said nothing"

    def tell(self, number: signal.Signals) -> None:
        """Send a signal to the command, and to what it has begun before the run: set-up."""
        if self.process is not None and self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, number)

    def kill(self) -> None:
        """End all of its processes at once."""
        if self.process is not None:
            self.tell(signal.SIGKILL)
            self.process.wait()
        try:
            run_id = RunSpec.load(self.folder / FILE).run_id
        except (OSError, ValueError, TypeError):
            return  # it had not come so far
        end_run(run_id, timeout_s=0.0)


class Members:
    """All of them; of a run that is no fleet's there are none."""

    def __init__(self, out: Path, members: Sequence[Member]) -> None:
        self._out = out
        self._members = members
        self._told: set[str] = set()

    def begin(self, stop: Callable[[], bool]) -> str:
        """Start them, and wait until each has begun, or until ``stop`` says so; return why one could not begin, empty where all have."""
        for member in self._members:
            member.start()
        while not stop() and not all(member.has_begun for member in self._members):
            ended = [member for member in self._members if not member.lives]
            if ended:
                self._told |= {member.name for member in ended}
                return f"{ended[0].name} could not be run: {ended[0].last_words}"
            time.sleep(LOOK_S)
        return ""

    def look(self) -> None:
        """Note which of them have ended although the mission runs."""
        for member in self._members:
            if not member.lives and member.name not in self._told and member.process is not None:
                self._told.add(member.name)
                note_death(self._out, Death(f"the run of {member.name}", describe_exit(member.process.poll()), None))

    def end(self, say: Callable[[str], None], at_once: Callable[[], bool]) -> None:
        """Tell them to end, and wait until they have: robots come to rest first, unless ``at_once`` says otherwise."""
        living = [member for member in self._members if member.lives]
        for member in living if not at_once() else ():
            member.tell(signal.SIGTERM)
        if living:
            say(f"the runs of {' and '.join(member.name for member in living)} end")
        end_s = time.monotonic() + END_TIMEOUT_S
        while any(member.lives for member in self._members) and not at_once() and time.monotonic() < end_s:
            time.sleep(LOOK_S)
        for member in self._members:
            if member.lives:
                member.kill()


def members_of(spec: RunSpec) -> Members:
    """Return those of a run."""
    robots = find_robot().robots
    return Members(Path(spec.out_dir), [Member(spec, name, robots[name].root, words) for name, words in spec.members.items()])


def reports_of(spec: RunSpec) -> list[str]:
    """Return where the reports of the robots are, a line each, with how their runs ended."""
    told = []
    for name in spec.members:
        folder = Path(spec.out_dir) / name
        try:
            outcome = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["outcome"] or "no outcome"
            told.append(f"{name}: {outcome}, {folder / 'report.html'}")
        except (OSError, ValueError, KeyError, TypeError):
            told.append(f"{name}: no report; {Path(spec.out_dir) / 'logs' / name}.log says what it did")
    return told
