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
from alula_flight.album import Album
from alula_flight.deaths import CONSEQUENCES, Consequence, DeathRecord, describe_exit
from alula_flight.ending import GIVEN_UP, finish
from alula_flight.process_faults import ProcessFaults, Started
from alula_flight.spec import RunSpec

LANDING_PATIENCE_S = 90.0  # mission clock; a landing from 20 m takes about 40 s
FOR_EVER_S = 2**31
STATE_PATIENCE_S = 30.0  # wall clock until the guidance, perhaps just started again, says how things are
ABORT_PATIENCE_S = 150.0  # wall clock; stop, hover, land
STANDSTILL_PATIENCE_S = 60.0  # wall clock without a tick of the mission clock
START_PATIENCE_S = 120.0  # wall clock until the mission clock runs

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
            consequence = CONSEQUENCES.get(name, Consequence.GO_ON)
            order = list(Consequence)
            self.worst = max(self.worst, consequence, key=order.index)
        self.changed.set()


class MissionClock:
    """The last tick of the mission clock, and how long ago it was on the wall."""

    def __init__(self, *, simulated: bool) -> None:
        self._simulated = simulated
        self._now_s: float | None = None
        self._moved = time.monotonic()

    def listen(self) -> None:
        """Subscribe to the clock; only where it is simulated."""
        if not self._simulated:
            return
        import rospy
        from rosgraph_msgs.msg import Clock

        rospy.Subscriber("/clock", Clock, self._tick, queue_size=1)

    def _tick(self, message: Any) -> None:
        self._now_s = message.clock.to_sec()
        self._moved = time.monotonic()

    @property
    def now_s(self) -> float | None:
        """Mission clock in seconds, or None before its first tick."""
        return self._now_s if self._simulated else time.time()

    @property
    def stands_still(self) -> bool:
        """Tell whether the clock has not moved for so long that nothing will move it any more."""
        patience_s = START_PATIENCE_S if self._now_s is None else STANDSTILL_PATIENCE_S
        return self._simulated and time.monotonic() - self._moved > patience_s


class Supervisor:
    """One run from roslaunch's start to its end."""

    def __init__(self, spec: RunSpec) -> None:
        self._spec = spec
        self._clock = MissionClock(simulated=spec.simulated)
        self._record = DeathRecord(Path(spec.out_dir) / "deaths.jsonl")
        self._watch = Watch(self._record, self._clock)
        self._asked_to_end = threading.Event()
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
        launch.start()
        # roslaunch has put its own handlers; ours let the vehicle land first.
        on_end_signal(self._end_asked)
        rospy.init_node("alula_supervisor", disable_signals=True)
        self._clock.listen()
        Album(Path(self._spec.out_dir)).listen()
        self._faults = ProcessFaults(self._spec.process_faults, functools.partial(process_of, launch.pm), Path(self._spec.out_dir))
        self._faults.listen()
        return launch

    def _end_asked(self) -> None:
        self._asked_to_end.set()
        self._watch.changed.set()

    def _until_over(self, launch: Any) -> int:
        abort_since: float | None = None
        while True:
            self._watch.changed.wait(timeout=0.2)
            self._watch.changed.clear()
            self._look_for_the_front()
            if self._watch.mission_exit is not None:
                if self._watch.mission_exit != 0:
                    self._land()  # what the mission could not bring down
                return self._watch.mission_exit if self._watch.worst is Consequence.GO_ON else GIVEN_UP
            if self._clock.stands_still:
                log.error("the mission clock has stood still for too long; ending the run")
                return GIVEN_UP
            if self._watch.worst is Consequence.END:
                return GIVEN_UP
            if self._watch.worst is Consequence.LAND:
                self._land()
                return GIVEN_UP
            if (self._asked_to_end.is_set() or self._watch.worst is Consequence.ABORT) and abort_since is None:
                abort_since = time.monotonic()
                self._abort_mission(launch)
            if abort_since is not None and time.monotonic() - abort_since > ABORT_PATIENCE_S:
                log.error("the mission did not end within %.0f s after it was told to", ABORT_PATIENCE_S)
                return GIVEN_UP

    def _look_for_the_front(self) -> None:
        """Note once that the front has died; the kernel has sent SIGTERM, so the mission is told to land."""
        if os.getppid() != self._front and not self._front_died:
            self._front_died = True
            self._record.add(Death(name="front", how="gone", when_s=self._clock.now_s))
            self._end_asked()

    def _abort_mission(self, launch: Any) -> None:
        """Tell the mission to stop what runs and land; it ends by itself when the vehicle is down."""
        mission = process_of(launch.pm, "mission")
        if mission is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(mission.popen.pid, signal.SIGINT)

    def _land(self) -> None:
        """Land through the guidance, because no mission decides any more; return when the vehicle is down or it takes too long.

        Nothing is done where the vehicle is down already, or where the pilot has it.
        """
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
        if not heard.wait(STATE_PATIENCE_S) or down.is_set() or not commanded:
            return
        end_s = (self._clock.now_s or 0.0) + LANDING_PATIENCE_S
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
