"""The supervisor of a run on what runs already: ``python -m alula_flight.attached RUN_SPEC``.

It starts the mission and the recorder of its bag, and nothing else, watches the deployment's parts, and ends when the mission does and the
robot is at rest. Exit code: the mission's, or 1.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from alula.common.scenarios import load_scenario
from alula.common.signals import on_end_signal
from alula.report.aborts import SIGNAL, SUPERVISOR, ReportedAbort, note_abort
from alula.report.deaths import Death, describe_exit, note_again, note_death
from alula.runtime.live.part import RunPart, part_of_robot
from alula.runtime.live.spec import RunSpec
from alula_flight.mission_clock import MissionClock
from alula_flight.outcome import GIVEN_UP, finish
from alula_flight.rest import Rest
from alula_flight.station import state as states
from alula_flight.station.parts import recording
from alula_flight.station.state import StationState
from alula_flight.station.station import Station

LOOK_S = 0.2
ABORT_TIMEOUT_S = 150.0  # wall clock, for the mission to bring the robot to rest
RECORDER_END_S = 15.0
BRIDGE = "bridge.json"

log = logging.getLogger("alula.attached")


class PartsWatch:
    """Notes in the run's record which of the deployment's parts end during it, and which run again."""

    def __init__(self, out: Path, folder: Path) -> None:
        self._out = out
        self._folder = folder
        self._deaths = {name: part.deaths for name, part in StationState.load(folder).parts.items()}
        self._dead: set[str] = set()

    def look(self, now_s: float) -> None:
        """Look at the keeper's account; ``now_s``: mission clock."""
        for name, part in StationState.load(self._folder).parts.items():
            if part.deaths > self._deaths.get(name, 0):
                self._deaths[name] = part.deaths
                self._dead.add(name)
                note_death(self._out, Death(name, part.why, now_s))
            if name in self._dead and part.state == states.RUNNING:
                self._dead.discard(name)
                note_again(self._out, name, now_s)


class AttachedSupervisor:
    """One mission, from its start to its end."""

    def __init__(self, spec: RunSpec, part: RunPart) -> None:
        self._spec = spec
        self._part = part
        self._out = Path(spec.out_dir)
        self._station = Station(spec.deployment)
        self._parts = PartsWatch(self._out, self._station.folder)
        self._front = os.getppid()
        self._asked: signal.Signals | None = None
        self._changed = threading.Event()
        self._clock = MissionClock()
        self._clock.begin(simulated=False)
        self._began_s = self._clock.now_s or 0.0
        self._serves = not load_scenario(spec.scenario).mission
        self._rest = Rest(
            spec,
            part,
            self._clock,
            look=self._look,
            told_to_end=lambda: self._told_to_end,
            note_abort=self._note_abort,
        )
        self.front_died = False

    def run(self) -> int:
        """Run; return the exit code."""
        on_end_signal(self._end_asked)
        self._listen()
        recorder = self._start("recorder", self._recording()) if self._station.deployment.topics else None
        mission = self._start("mission", self._mission())
        try:
            return self._until_over(mission)
        finally:
            if mission.poll() is None:
                mission.kill()
            if recorder is not None:
                self._end_recorder(recorder)
            with contextlib.suppress(OSError):  # of all that it has carried since its start
                shutil.copy(self._station.places.logs / BRIDGE, self._out / "logs" / BRIDGE)

    def _recording(self) -> tuple[str, ...]:
        words = recording(self._out / "functional.bag", self._station.deployment.topics, all_the_time=False)
        return self._station.places.in_ros1(*words)

    def _mission(self) -> tuple[str, ...]:
        words = ["python", "-m", "skillset_ros2.mission", "--scenario", self._spec.scenario, "--out", self._spec.out_dir]
        words += ["--world", self._spec.world, "--ros-args", "-p", "heartbeat:=false", "-p", "joins:=true"]
        words += ["-p", f"groot:='{self._spec.groot}'"] if self._spec.groot else []
        return self._station.places.in_ros2("mission", *words)

    def _start(self, name: str, words: tuple[str, ...]) -> subprocess.Popen[bytes]:
        """Start a process of the run, in a session of its own, so that no signal reaches it but ours."""
        with (self._out / "logs" / f"{name}.log").open("wb") as said:
            return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True)

    def _listen(self) -> None:
        """Have the robot's part hear its topics, as a node beside what runs already."""
        import rospy

        try:
            rospy.init_node("alula_supervisor", anonymous=True, disable_signals=True)
            self._part.listen(self._spec, lambda _: None)
        except (rospy.ROSException, OSError) as error:  # the master has gone just now: the mission may do without it
            log.error("the robot is not watched: %s", error)

    def _until_over(self, mission: subprocess.Popen[bytes]) -> int:
        told_s: float | None = None
        while mission.poll() is None:
            self._look()
            if told_s is None and self._told_to_end:
                told_s = time.monotonic()
                self._note_abort()
                mission.send_signal(signal.SIGINT)
            if told_s is not None and time.monotonic() - told_s > ABORT_TIMEOUT_S:
                log.error("the mission did not end within %.0f s after it was asked to", ABORT_TIMEOUT_S)
                return GIVEN_UP
        if mission.returncode < 0:
            death = Death("mission", describe_exit(mission.returncode), self._clock.now_s)
            note_death(self._out, death)
            note_abort(self._out, ReportedAbort(SUPERVISOR, f"{death.name} died ({death.how})", death.when_s))
        if mission.returncode != 0 or self._serves or self._rest.held.look():
            self._rest.bring()  # what the mission could not, or there was none
        return mission.returncode if mission.returncode >= 0 else GIVEN_UP

    def _look(self) -> None:
        """Wait a moment, and look what is new."""
        self._changed.wait(LOOK_S)
        self._changed.clear()
        self._parts.look(self._clock.now_s or 0.0)
        self._look_for_the_front()
        self._rest.held.look()

    @property
    def _told_to_end(self) -> bool:
        """Return whether somebody, or the run's limit, wants the run to end."""
        return self._asked is not None or self.front_died or self._over_time

    @property
    def _over_time(self) -> bool:
        """Return whether the mission has lasted for as long as it may."""
        return bool(self._spec.limit_s) and (self._clock.now_s or 0.0) - self._began_s > self._spec.limit_s

    def _note_abort(self) -> None:
        if self.front_died:
            note_abort(self._out, ReportedAbort(SUPERVISOR, "the front has died", self._clock.now_s))
        elif self._asked is not None:
            note_abort(self._out, ReportedAbort(SIGNAL, f"{self._asked.name} to the supervisor", self._clock.now_s))
        else:
            note_abort(self._out, ReportedAbort(SUPERVISOR, f"its limit of {self._spec.limit_s:g} s is over", self._clock.now_s))

    def _look_for_the_front(self) -> None:
        if os.getppid() != self._front and not self.front_died:
            self.front_died = True
            note_death(self._out, Death("front", "gone", self._clock.now_s))

    def _end_asked(self, number: signal.Signals) -> None:
        self._asked = number
        self._changed.set()

    def _end_recorder(self, recorder: subprocess.Popen[bytes]) -> None:
        """Have it write its bag's index."""
        recorder.send_signal(signal.SIGINT)
        try:
            recorder.wait(RECORDER_END_S)
        except subprocess.TimeoutExpired:
            recorder.kill()


def main(arguments: list[str]) -> int:
    """Run what the specification file says."""
    logging.basicConfig(level=logging.INFO)
    spec = RunSpec.load(Path(arguments[0]))
    supervisor = AttachedSupervisor(spec, part_of_robot())
    code = supervisor.run()
    if supervisor.front_died:
        finish(spec, code)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
