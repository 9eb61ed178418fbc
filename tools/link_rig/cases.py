"""The cases: what goes while a robot drives or flies, for how long, and what its mission may then say."""

from __future__ import annotations

import functools
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from alula_testing.waits import until
from link_rig.computers import LOOK_S, Mission, RigError, TwoComputers, two_computers
from link_rig.robots import INSPECTION, MAPPING, PATROL, SLOW_PATROL, Robot
from link_rig.verdicts import End, Fault, Verdict, driving_since, judge

DRIVES_S = 2.0
"""So long, in simulated seconds, has the rover driven when the fault comes."""
HIGH_M, LANDS_M, ON_ITS_WAY_M, THERE_M = 2.5, 2.0, 3.0, 1.0
"""Heights over the ground of a drone that has taken off and of one that lands; how far it is on its leg, and how near to its end."""
MISSION_S = 600.0
"""Wall clock; a mission that lasts longer hangs."""
DELAY_S, LOSS, SEED = 0.3, 0.2, 1
"""Of a bad link: each way, of each frame."""
LINK = ("link", "heartbeat", "silent")
"""What a true cause of a lost link names one of."""
OFFSET_S = 0.5
"""So nearly is a clock's step of an hour told; the base's clock is right."""
HOUR_S = 3600
ON_A_LEG = ("to-base", "to-decision", "bad", "bridge", "managers", "mission")
"""Cases of the rover that come to a flight, too."""
Act = Callable[[TwoComputers, Mission], AbstractContextManager[None]]
Phase = Callable[[TwoComputers, Mission], bool]


@dataclass(frozen=True)
class Case:
    """A fault, prepared by ``act`` and made by entering what that returns.

    It comes with the ``phase``, and lasts ``lasts_s`` simulated seconds at least. ``again``: another mission has to be accomplished after
    it. ``stops``: as long as it lasts nobody can supervise the robot. ``world_ends``: simulator and truth end with it, and begin anew; it
    lasts so long by the wall clock. ``sets_clock``: the decision computer's wall clock can be set. ``look`` returns what is wrong
    after the mission.
    """

    name: str
    act: Act
    lasts_s: float
    cause: tuple[str, ...]
    again: bool = False
    stops: bool = True
    robot: Robot = PATROL
    phase: Phase | None = None
    world_ends: bool = False
    sets_clock: bool = False
    look: Callable[[TwoComputers], tuple[str, ...]] | None = None


def _nothing(_rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return nullcontext()


def _cut(rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return rig.network.cut(rig.base, rig.decision)


def _to_base(rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return rig.network.cut(rig.decision, rig.base, one_way=True)


def _to_decision(rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return rig.network.cut(rig.base, rig.decision, one_way=True)


def _address(rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return rig.network.without_address(rig.decision)


def _bad(rig: TwoComputers, _mission: Mission) -> AbstractContextManager[None]:
    return rig.network.bad_cable(rig.decision, delay_s=DELAY_S, loss=LOSS, seed=SEED)


@contextmanager
def _master(rig: TwoComputers, _mission: Mission) -> Iterator[None]:
    rig.kill_master()
    yield
    rig.start_master()


def _kill(part: str) -> Act:
    def act(rig: TwoComputers, mission: Mission) -> AbstractContextManager[None]:
        return _killed(mission.pid if part == "mission" else rig.pid_of(part))

    return act


@contextmanager
def _killed(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGKILL)
    yield


@contextmanager
def _reboot(rig: TwoComputers, _mission: Mission) -> Iterator[None]:
    rig.kill_all(rig.decision)
    yield
    rig.up()


@contextmanager
def _base_reboot(rig: TwoComputers, _mission: Mission) -> Iterator[None]:
    rig.kill_all(rig.base)
    yield
    rig.start_base()


def _step(by_s: int) -> Act:
    @contextmanager
    def act(rig: TwoComputers, _mission: Mission) -> Iterator[None]:
        rig.step_clock(by_s)
        yield  # it stays so

    return act


def _tells_the_step(by_s: int) -> Callable[[TwoComputers], tuple[str, ...]]:
    """Return a look at whether doctor and status (which the page shows) tell by how far the base's clock is now from ours."""

    def look(rig: TwoComputers) -> tuple[str, ...]:
        told = {"doctor": rig.clock_by_doctor(), "status": rig.clock_by_status()}
        return tuple(
            f"{who} tells {ahead_s} s of the base's clock, not {-by_s} s"
            for who, ahead_s in told.items()
            if ahead_s is None or abs(ahead_s + by_s) > OFFSET_S
        )

    return look


def _drives(rig: TwoComputers, _mission: Mission) -> bool:
    since_s = driving_since(rig.poses())
    return since_s is not None and _now(rig) - since_s >= DRIVES_S


def _before_take_off(_rig: TwoComputers, mission: Mission) -> bool:
    return "mission" in mission.processes


def _on_a_leg(rig: TwoComputers, _mission: Mission) -> bool:
    return rig.poses()[-1].x >= ON_ITS_WAY_M


def _lands(rig: TwoComputers, _mission: Mission) -> bool:
    poses = rig.poses()
    flew = max(one.z for one in poses) - poses[0].z > HIGH_M
    return flew and poses[-1].x > rig.robot.goal_m - THERE_M and poses[-1].z - poses[0].z < LANDS_M


def _cuts_of_a_flight(robot: Robot) -> dict[str, Case]:
    phases = {"ground": ("before take-off", _before_take_off), "leg": ("on a leg", _on_a_leg), "landing": ("as it lands", _lands)}
    return {
        f"{robot.scenario}-{name}-{lasts_s:g}": Case(
            f"{robot.scenario}, {when}: link cut for {lasts_s:g} s", _cut, lasts_s, LINK, robot=robot, phase=phase
        )
        for name, (when, phase) in phases.items()
        for lasts_s in (5.0, 30.0)
    }


ROVERS: Mapping[str, Case] = {
    "slow": Case("nothing, with a base that takes five seconds for one", _nothing, 0.0, (), robot=SLOW_PATROL, stops=False),
    "cut-0.2": Case("link cut for 0.2 s", _cut, 0.2, LINK),
    "cut-5": Case("link cut for 5 s", _cut, 5.0, LINK),
    "cut-30": Case("link cut for 30 s", _cut, 30.0, LINK),
    "cut-120": Case("link cut for 120 s", _cut, 120.0, LINK),
    "to-base": Case("nothing passes to the base for 30 s", _to_base, 30.0, LINK),
    "to-decision": Case("nothing passes to the decision side for 30 s", _to_decision, 30.0, LINK),
    "half-open": Case("the decision computer without its address for 30 s", _address, 30.0, LINK),
    "bad": Case(f"{LOSS:.0%} loss and {DELAY_S:g} s of delay each way for 30 s", _bad, 30.0, LINK, stops=False),
    "master": Case("the ROS master killed, and another one after 5 s", _master, 5.0, ("master", *LINK), stops=False),
    "bridge": Case("the bridge killed", _kill("bridge"), 0.0, ("bridge", *LINK)),
    "managers": Case("the managers killed", _kill("managers"), 0.0, ("managers", *LINK)),
    "mission": Case("the mission killed", _kill("mission"), 0.0, ("mission died",), again=True),
    "reboot": Case("decision computer off for 10 s", _reboot, 10.0, ("no summary",), again=True),
    "base-reboot": Case("the base's computer off for 20 s", _base_reboot, 20.0, LINK, again=True, stops=False, world_ends=True),
    **{
        f"clock-{name}": Case(
            f"the decision computer's clock set by {by_s:+d} s",
            _step(by_s),
            5.0,
            (),
            stops=False,
            sets_clock=True,
            look=_tells_the_step(by_s),
        )
        for name, by_s in (("back", -HOUR_S), ("ahead", HOUR_S))
    },
}

CASES: Mapping[str, Case] = {
    **ROVERS,
    "mapping-reboot": Case(
        "mapping, on a leg: decision computer off for 10 s", _reboot, 10.0, ("no summary",), again=True, robot=MAPPING, phase=_on_a_leg
    ),
    "mapping-base-reboot": Case(
        "mapping, on a leg: the base's computer off for 20 s",
        _base_reboot,
        20.0,
        LINK,
        again=True,
        stops=False,
        robot=MAPPING,
        phase=_on_a_leg,
        world_ends=True,
    ),
    **_cuts_of_a_flight(MAPPING),
    **_cuts_of_a_flight(INSPECTION),
    **{
        f"mapping-{name}": replace(case, name=f"mapping, on a leg: {case.name}", robot=MAPPING, phase=_on_a_leg)
        for name, case in ROVERS.items()
        if name in ON_A_LEG
    },
    "mapping-leg-120": Case("mapping, on a leg: link cut for 120 s", _cut, 120.0, LINK, robot=MAPPING, phase=_on_a_leg),
}


def run_case(case: Case, folder: Path) -> Verdict:
    """Run a whole mission with the fault in its phase; ``folder`` takes what is written. Judge it by the simulator's truth."""
    with two_computers(case.robot, folder, sets_clock=case.sets_clock) as rig:
        mission, phase = rig.start_mission(), case.phase or _drives
        until(lambda: mission.ended or phase(rig, mission), f"the fault's phase comes ({folder})", MISSION_S, LOOK_S)
        if mission.ended:
            raise RigError(f"the mission ended before the fault: {mission.end.reason} ({folder})")
        act = case.act(rig, mission)
        clock = time.monotonic if case.world_ends else functools.partial(_now, rig)
        begun_s, due_s = _now(rig), clock() + case.lasts_s
        with act:
            until(lambda: clock() >= due_s, "time passes", MISSION_S, LOOK_S)
        begun_s, ended_s = (0.0, 0.0) if case.world_ends else (begun_s, _now(rig))
        until(lambda: mission.ended, f"the mission ends ({folder})", MISSION_S, LOOK_S)
        end, following = mission.end, _one_more(rig) if case.again else None
        verdict = judge(
            Fault(case.name, begun_s, ended_s, case.cause, case.stops),
            end,
            rig.poses(),
            beats=rig.beats(),
            collisions=rig.collisions,
            silent_after_s=rig.silent_after_s,
            following=following,
            still=case.robot.still,
        )
        return replace(verdict, wrong=(*verdict.wrong, *case.look(rig))) if case.look else verdict


def _one_more(rig: TwoComputers) -> End:
    mission = rig.start_mission()
    until(lambda: mission.ended, f"the next mission ends ({rig.folder})", MISSION_S, LOOK_S)
    return mission.end


def _now(rig: TwoComputers) -> float:
    return rig.poses()[-1].stamp_s
