"""Start a run with roslaunch, watch its processes, and end it: ``python -m alula_flight.supervisor RUN_SPEC``.

The supervisor lives in a process of its own, started by the front (`alula_flight.run`). It ends when the mission's process ends,
or when what died or a signal makes the run pointless, or its time is over. Exit code: the mission's, or 1.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import signal
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.common.processes import end_run
from alula.common.scenarios import load_scenario
from alula.common.signals import on_end_signal
from alula.records.departure import Departure
from alula.report.aborts import SIGNAL, SUPERVISOR, ReportedAbort, note_abort
from alula.report.deaths import Death, describe_exit, note_again, note_death
from alula.runtime.live.part import DEAD_S, Consequence, RunPart, part_of_robot
from alula.runtime.live.spec import RunSpec
from alula_flight.launch import launch_arguments, launch_file
from alula_flight.mission_clock import MissionClock
from alula_flight.mission_watch import SILENT_S, MissionWatch
from alula_flight.outcome import GIVEN_UP, finish
from alula_flight.process_faults import ProcessFaults, Started, process_faults_of
from alula_flight.rest import Rest
from alula_flight.waits import Beginning

OF_EVERY_ROBOT = {"mission": Consequence.REST, "master": Consequence.ABORT}
"""What the death of a process means whose name is the same in every run; the robot's part knows of the others."""
ABORT_TIMEOUT_S = 150.0  # wall clock, for the mission to bring the robot to rest

log = logging.getLogger("alula.supervisor")


@dataclass(frozen=True)
class Dead:
    """A process that died in its ``spawn_count``-th life."""

    death: Death
    spawn_count: int


class Watch:
    """Listens to roslaunch's process monitor: which process died, and with which code."""

    def __init__(self, out: Path, clock: MissionClock, part: RunPart) -> None:
        self._out = out
        self._clock = clock
        self._consequences = {**OF_EVERY_ROBOT, **part.consequences}
        self._stays_dead = part.stays_dead
        self._told: set[tuple[str, int]] = set()
        self._dead: dict[str, Dead] = {}
        """By the process monitor's name."""
        self._launch: Any = None
        self.mission_exit: int | None = None
        self.worst = Consequence.GO_ON
        self.worst_death = ""  # which death it was, in words
        self.changed = threading.Event()
        self.ending = False

    def follow(self, launch: Any) -> None:
        """Listen to a roslaunch parent; before it starts, for a process may die before its start returns."""
        self._launch = launch

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Note a death; called by the process monitor's thread, again and again until the process runs again."""
        if self.ending:
            return
        process = self._launch.pm.get_process(process_name)
        key = (process_name, getattr(process, "spawn_count", 0))
        if key in self._told:
            return
        self._told.add(key)
        name = process_name.rsplit("-", 1)[0]
        if name == "mission" and exit_code is not None and exit_code >= 0:
            self.mission_exit = exit_code
        else:
            death = Death(name=name, how=describe_exit(exit_code), when_s=self._clock.now_s)
            note_death(self._out, death)
            self._dead[process_name] = Dead(death, key[1])
            self._note_consequence(self._consequences.get(name, Consequence.GO_ON), f"{name} died ({death.how})")
        self.changed.set()

    def look(self) -> None:
        """Note which of the dead run again, and what follows where one does not."""
        now_s = self._clock.now_s
        for process_name, dead in list(self._dead.items()):
            name = dead.death.name
            if getattr(self._launch.pm.get_process(process_name), "spawn_count", 0) > dead.spawn_count:
                del self._dead[process_name]
                note_again(self._out, name, now_s)
            elif now_s is not None and now_s - (dead.death.when_s or 0.0) > DEAD_S:
                self._note_consequence(self._stays_dead.get(name, Consequence.GO_ON), f"{name} died ({dead.death.how}) and stayed dead")

    def _note_consequence(self, consequence: Consequence, death: str) -> None:
        order = list(Consequence)
        if order.index(consequence) > order.index(self.worst):
            self.worst, self.worst_death = consequence, death


class Supervisor:
    """One run from roslaunch's start to its end."""

    def __init__(self, spec: RunSpec, part: RunPart) -> None:
        self._spec = spec
        self._part = part
        self._out = Path(spec.out_dir)
        self._clock = MissionClock()
        self._watch = Watch(self._out, self._clock, part)
        self._serves = not load_scenario(spec.scenario).mission
        self._asked_to_end: signal.Signals | None = None
        self._began_s: float | None = None  # mission clock
        self._beginning = Beginning(spec, part, self._clock)
        self._rest = Rest(
            spec,
            part,
            self._clock,
            look=self._look,
            told_to_end=lambda: self._told_to_end,
            note_abort=self._note_abort,
            lost=lambda: self._watch.worst is Consequence.END,
        )
        self._departure = Departure(self._out)
        self._mission = MissionWatch(self._clock)
        self._front = os.getppid()
        self._front_died = False
        self._faults: ProcessFaults | None = None

    @property
    def front_died(self) -> bool:
        """Return whether the front, which makes the report, has died."""
        return self._front_died

    def run(self) -> int:
        """Run; return the exit code."""
        launch = self._start()
        try:
            return self._until_over(launch)
        finally:
            self._watch.ending = True
            if self._faults is not None:
                self._faults.release()
            launch.shutdown()

    def _start(self) -> Any:
        import rospy
        from roslaunch.parent import ROSLaunchParent

        launch = ROSLaunchParent(
            "nodes",
            [(launch_file(load_scenario(self._spec.scenario)), launch_arguments(self._spec, self._part))],
            port=self._spec.master_port,
            process_listeners=[self._watch],
            sigint_timeout=5.0,
            sigterm_timeout=2.0,
        )
        self._watch.follow(launch)
        self._beginning.look()
        launch.start()
        # roslaunch has put its own handlers; ours let the robot come to rest first.
        on_end_signal(self._end_asked)
        rospy.init_node("alula_supervisor", disable_signals=True)
        faults = process_faults_of(self._spec)
        self._faults = ProcessFaults(faults, functools.partial(process_of, launch.pm), self._out)
        self._clock.listen(self._faults.look)
        self._part.listen(self._spec, self._faults.departed)
        self._mission.listen()
        if self._part.cameras:
            from alula_flight.thumbnails import Thumbnails  # late: it needs OpenCV

            Thumbnails(self._out, lambda: self._clock.now_s or 0.0).listen(self._part.cameras)
        return launch

    def _end_asked(self, number: signal.Signals) -> None:
        self._asked_to_end = number
        self._watch.changed.set()

    def _ends(self, why: str) -> None:
        """Note that the supervisor ends the run by itself."""
        log.error("the run is ended: %s", why)
        note_abort(self._out, ReportedAbort(SUPERVISOR, why, self._clock.now_s))

    def _note_abort(self) -> None:
        """Note who has the mission come to rest, and why; what the front has noted before it asked for it stays."""
        if self._front_died:
            self._ends("the front has died")
        elif self._asked_to_end is not None:
            note_abort(self._out, ReportedAbort(SIGNAL, f"{self._asked_to_end.name} to the supervisor", self._clock.now_s))
        elif self._over_time:
            self._ends(f"its limit of {self._spec.limit_s:g} s is over")
        else:
            self._ends(self._watch.worst_death)

    @property
    def _over_time(self) -> bool:
        """Return whether the run has lasted for as long as it may, by the mission clock."""
        now_s = self._clock.now_s
        if not self._spec.limit_s or now_s is None:
            return False
        self._began_s = now_s if self._began_s is None else self._began_s
        return now_s - self._began_s > self._spec.limit_s

    def _until_over(self, launch: Any) -> int:
        abort_since: float | None = None
        while True:
            self._look()
            self._beginning.look()
            held = self._rest.held.look()
            if self._watch.mission_exit is not None:
                if self._watch.mission_exit != 0 or self._serves or held:
                    self._rest.bring()  # what the mission could not, or there was none
                return self._watch.mission_exit if self._watch.worst is Consequence.GO_ON else GIVEN_UP
            if self._clock.stands_still:
                self._ends(f"{self._clock.standstill}: nothing came from {self._part.clock_source(self._spec)}")
                return GIVEN_UP
            if self._watch.worst is Consequence.END:
                self._ends(self._watch.worst_death)
                return GIVEN_UP
            if self._watch.worst is Consequence.REST:
                self._ends(self._watch.worst_death)
                self._rest.bring()
                return GIVEN_UP
            if self._mission.silent:
                self._ends(f"the mission's process runs, and has not been heard for {SILENT_S:g} s")
                self._rest.bring()
                return GIVEN_UP
            if (self._told_to_end or self._watch.worst is Consequence.ABORT) and abort_since is None:
                abort_since = time.monotonic()
                self._note_abort()
                self._abort_mission(launch)
            if abort_since is not None and time.monotonic() - abort_since > ABORT_TIMEOUT_S:
                log.error("the mission did not end within %.0f s after it was asked to", ABORT_TIMEOUT_S)
                return GIVEN_UP

    @property
    def _told_to_end(self) -> bool:
        """Return whether somebody, or the run's limit, wants the run to end."""
        return self._asked_to_end is not None or self._front_died or self._over_time

    def _look(self) -> None:
        """Wait a moment, and look what is new."""
        self._watch.changed.wait(timeout=0.2)
        self._watch.changed.clear()
        self._look_for_the_front()
        self._apply_faults()
        self._watch.look()

    def _apply_faults(self) -> None:
        """Have faults of processes begin and end, as far as the ticks of the mission clock don't."""
        if self._faults is None or not self._faults.asked:
            return
        departed_s = self._departure.look()
        if departed_s is not None and not self._faults.counts:
            self._faults.departed(departed_s)
        if not self._clock.simulated and self._clock.now_s is not None:
            self._faults.look(self._clock.now_s)

    def _look_for_the_front(self) -> None:
        """Note once that the front has died; the kernel has sent SIGTERM, so the mission is told to end."""
        if os.getppid() != self._front and not self._front_died:
            self._front_died = True
            note_death(self._out, Death(name="front", how="gone", when_s=self._clock.now_s))

    def _abort_mission(self, launch: Any) -> None:
        """Request the mission's abort; it ends by itself when the robot is at rest."""
        mission = process_of(launch.pm, "mission")
        if mission is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(mission.popen.pid, signal.SIGINT)


def process_of(monitor: Any, node: str) -> Started | None:
    """Return the process of a node; roslaunch counts the processes and puts the number behind the name."""
    name = next((name for name in monitor.get_active_names() if name.rsplit("-", 1)[0] == node), None)
    process: Started | None = None if name is None else monitor.get_process(name)
    return process


def main(arguments: list[str]) -> int:
    """Run what the specification file says."""
    spec = RunSpec.load(Path(arguments[0]))
    logging.basicConfig(level=logging.INFO)
    supervisor = Supervisor(spec, part_of_robot())
    code = supervisor.run()
    if supervisor.front_died:
        end_run(spec.run_id)
        finish(spec, code)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
