"""Start a run with roslaunch, watch its processes, and end it: ``python -m alula_flight.supervisor RUN_SPEC``.

The supervisor lives in a process of its own, started by the front (`alula_flight.fly`). It ends when the mission's process ends,
or when what died or a signal makes the run pointless. Exit code: the mission's, or 1.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from alula.common.processes import end_run
from alula.common.scenarios import load_scenario
from alula.common.signals import on_end_signal
from alula.report.deaths import Death
from alula.report.ends import SIGNAL, SUPERVISOR, Ended, note_end
from alula_flight.album import Album
from alula_flight.deaths import CONSEQUENCES, Consequence, DeathRecord, describe_exit
from alula_flight.ending import GIVEN_UP, finish
from alula_flight.mission_clock import MissionClock
from alula_flight.process_faults import ProcessFaults, Started
from alula_flight.spec import RunSpec
from alula_flight.waits import Beginning, clock_words

LANDING_TIMEOUT_S = 90.0  # mission clock; a landing from 20 m takes about 40 s
FOR_EVER_S = 2**31
STATE_TIMEOUT_S = 30.0  # wall clock until the guidance, perhaps just started again, says how things are
ABORT_TIMEOUT_S = 150.0  # wall clock; stop, hover, land

log = logging.getLogger("alula.supervisor")


class Watch:
    """Listens to roslaunch's process monitor: which process died, and with which code."""

    def __init__(self, record: DeathRecord, clock: MissionClock) -> None:
        self._record = record
        self._clock = clock
        self._told: set[tuple[str, int]] = set()
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
            respawned = bool(getattr(process, "respawn", False)) and math.isfinite(getattr(process, "respawn_delay", 0.0))
            self._record.add(Death(name=name, how=describe_exit(exit_code), when_s=self._clock.now_s, respawned=respawned))
            self._note_consequence(CONSEQUENCES.get(name, Consequence.GO_ON), f"{name} died ({describe_exit(exit_code)})")
        self.changed.set()

    def _note_consequence(self, consequence: Consequence, death: str) -> None:
        order = list(Consequence)
        if order.index(consequence) > order.index(self.worst):
            self.worst, self.worst_death = consequence, death


class Supervisor:
    """One run from roslaunch's start to its end."""

    def __init__(self, spec: RunSpec) -> None:
        self._spec = spec
        self._out = Path(spec.out_dir)
        self._clock = MissionClock(simulated=spec.simulated)
        self._record = DeathRecord(self._out / "deaths.jsonl")
        self._watch = Watch(self._record, self._clock)
        self._asked_to_end: signal.Signals | None = None
        self._beginning = Beginning(spec)
        self._front = os.getppid()
        self._front_died = False
        self._last_heartbeat: Any = None
        self._faults: ProcessFaults | None = None

    @property
    def front_died(self) -> bool:
        """Tell whether the front, which makes the report, has died."""
        return self._front_died

    def run(self) -> int:
        """Fly; return the exit code."""
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
        from roslib.packages import find_resource

        (launch_file,) = find_resource(*load_scenario(self._spec.scenario).launch.split("/"))[:1]
        launch = ROSLaunchParent(
            "nodes",
            [(launch_file, self._spec.launch_arguments())],
            port=self._spec.master_port,
            process_listeners=[self._watch],
            sigint_timeout=5.0,
            sigterm_timeout=2.0,
        )
        self._watch.follow(launch)
        self._beginning.look(clock=False)
        launch.start()
        # roslaunch has put its own handlers; ours let the vehicle land first.
        on_end_signal(self._end_asked)
        rospy.init_node("alula_supervisor", disable_signals=True)
        self._clock.listen()
        self._beginning.listen()
        Album(self._out).listen()
        self._faults = ProcessFaults(self._spec.process_faults, functools.partial(process_of, launch.pm), self._out)
        self._faults.listen()
        return launch

    def _end_asked(self, number: signal.Signals) -> None:
        self._asked_to_end = number
        self._watch.changed.set()

    def _ends(self, why: str) -> None:
        """Note that the supervisor ends the run by itself."""
        log.error("the run is ended: %s", why)
        note_end(self._out, Ended(SUPERVISOR, why, self._clock.now_s))

    def _note_abort(self) -> None:
        """Note who has the mission land, and why; what the front has noted before it asked for it stays."""
        if self._front_died:
            self._ends("the front has died")
        elif self._asked_to_end is not None:
            note_end(self._out, Ended(SIGNAL, f"{self._asked_to_end.name} to the supervisor", self._clock.now_s))
        else:
            self._ends(self._watch.worst_death)

    def _until_over(self, launch: Any) -> int:
        abort_since: float | None = None
        while True:
            self._watch.changed.wait(timeout=0.2)
            self._watch.changed.clear()
            self._look_for_the_front()
            self._beginning.look(clock=self._clock.began)
            if self._watch.mission_exit is not None:
                if self._watch.mission_exit != 0:
                    self._land()  # what the mission could not bring down
                return self._watch.mission_exit if self._watch.worst is Consequence.GO_ON else GIVEN_UP
            if self._clock.stands_still:
                self._ends(f"{self._clock.standstill}: nothing came from {clock_words(self._spec)}")
                return GIVEN_UP
            if self._watch.worst is Consequence.END:
                self._ends(self._watch.worst_death)
                return GIVEN_UP
            if self._watch.worst is Consequence.LAND:
                self._land()
                return GIVEN_UP
            asked = self._asked_to_end is not None or self._front_died or self._watch.worst is Consequence.ABORT
            if asked and abort_since is None:
                abort_since = time.monotonic()
                self._note_abort()
                self._abort_mission(launch)
            if abort_since is not None and time.monotonic() - abort_since > ABORT_TIMEOUT_S:
                log.error("the mission did not end within %.0f s after it was told to", ABORT_TIMEOUT_S)
                return GIVEN_UP

    def _look_for_the_front(self) -> None:
        """Note once that the front has died; the kernel has sent SIGTERM, so the mission is told to land."""
        if os.getppid() != self._front and not self._front_died:
            self._front_died = True
            self._record.add(Death(name="front", how="gone", when_s=self._clock.now_s))

    def _abort_mission(self, launch: Any) -> None:
        """Tell the mission to stop what runs and land; it ends by itself when the vehicle is down."""
        mission = process_of(launch.pm, "mission")
        if mission is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(mission.popen.pid, signal.SIGINT)

    def _land(self) -> None:
        """Land through the guidance, because no mission decides any more; return when the vehicle is down or it takes too long.

        Nothing is done where the vehicle is down already, where the pilot has it, or where time has not begun.
        """
        if not self._clock.began:
            return
        import rospy
        from uav_msgs.msg import GuidanceState
        from uav_msgs.srv import Command

        self._end_heartbeats()
        heard, down = threading.Event(), threading.Event()
        commanded, reference = False, ""

        def look(state: Any) -> None:
            nonlocal commanded, reference
            commanded, reference = state.authority, state.reference
            if not state.armed:
                down.set()
            heard.set()

        rospy.Subscriber("/uav_guidance/state", GuidanceState, look, queue_size=1)
        if not heard.wait(STATE_TIMEOUT_S) or down.is_set() or not commanded:
            return
        end_s = (self._clock.now_s or 0.0) + LANDING_TIMEOUT_S
        # Again where something else is followed instead: a skill that was running may have answered the first with a hover.
        while not down.is_set() and (self._clock.now_s or 0.0) < end_s and not self._clock.stands_still:
            if reference != "land" and commanded:
                try:
                    rospy.wait_for_service("/uav_guidance/land", timeout=10.0)
                    answer = rospy.ServiceProxy("/uav_guidance/land", Command)()
                    log.info("landing: %s %s", answer.accepted, answer.reason)
                except (rospy.ROSException, rospy.ServiceException) as error:
                    log.error("the guidance could not be told to land: %s", error)
            down.wait(1.0)

    def _end_heartbeats(self) -> None:
        """Have simulated time wait no more for a mission that has ended: its heartbeats came over the bridge, which goes on."""
        import rospy
        from std_msgs.msg import Header

        if self._spec.simulated and self._last_heartbeat is None:
            self._last_heartbeat = rospy.Publisher("/mission/heartbeat", Header, queue_size=1, latch=True)
            self._last_heartbeat.publish(Header(stamp=rospy.Time(FOR_EVER_S), frame_id="supervisor"))


def process_of(monitor: Any, node: str) -> Started | None:
    """Return the process of a node; roslaunch counts the processes and puts the number behind the name."""
    name = next((name for name in monitor.get_active_names() if name.rsplit("-", 1)[0] == node), None)
    process: Started | None = None if name is None else monitor.get_process(name)
    return process


def main(arguments: list[str]) -> int:
    """Fly the run of the specification file."""
    spec = RunSpec.load(Path(arguments[0]))
    logging.basicConfig(level=logging.INFO)
    supervisor = Supervisor(spec)
    code = supervisor.run()
    if supervisor.front_died:
        end_run(spec.run_id)
        finish(spec, code)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
