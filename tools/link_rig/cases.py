"""The cases: what goes while the rover drives, for how long, and what its mission may then say."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from alula_testing.waits import until
from link_rig.computers import LOOK_S, Mission, RigError, TwoComputers, two_computers
from link_rig.verdicts import End, Fault, Verdict, driving_since, judge

DRIVES_S = 2.0
"""So long, in simulated seconds, has it driven when the fault comes."""
MISSION_S = 600.0
"""Wall clock; a mission that lasts longer hangs."""
DELAY_S, LOSS, SEED = 0.3, 0.2, 1
"""Of a bad link: each way, of each frame."""
LINK = ("link", "heartbeat", "silent")
"""What a true cause of a lost link names one of."""
Act = Callable[[TwoComputers, Mission], AbstractContextManager[None]]


@dataclass(frozen=True)
class Case:
    """A fault, prepared by ``act`` and made by entering what that returns.

    It lasts ``lasts_s`` simulated seconds at least. ``again``: the mission can't survive it, and another one has to be accomplished.
    ``stops``: as long as it lasts nobody can supervise the rover.
    """

    name: str
    act: Act
    lasts_s: float
    cause: tuple[str, ...]
    again: bool = False
    stops: bool = True


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


CASES: Mapping[str, Case] = {
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
}


def run_case(case: Case, folder: Path) -> Verdict:
    """Run a whole mission with the fault while it drives; ``folder`` takes what is written. Judge it by the simulator's truth."""
    with two_computers(folder) as rig:
        mission = rig.start_mission()
        until(lambda: mission.ended or _drives(rig), "the rover drives", every_s=LOOK_S)
        if mission.ended:
            raise RigError(f"the mission ended before the rover drove: {mission.end.reason} ({folder})")
        act = case.act(rig, mission)
        begun_s = _now(rig)
        with act:
            until(lambda: _now(rig) >= begun_s + case.lasts_s, "simulated time passes", MISSION_S, LOOK_S)
        ended_s = _now(rig)
        until(lambda: mission.ended, f"the mission ends ({folder})", MISSION_S, LOOK_S)
        fault = Fault(case.name, begun_s, ended_s, case.cause, case.stops)
        following = _one_more(rig) if case.again else None
        return judge(
            fault,
            mission.end,
            rig.poses(),
            beats=rig.beats(),
            collisions=rig.collisions,
            silent_after_s=rig.silent_after_s,
            following=following,
        )


def _one_more(rig: TwoComputers) -> End:
    mission = rig.start_mission()
    until(lambda: mission.ended, f"the next mission ends ({rig.folder})", MISSION_S, LOOK_S)
    return mission.end


def _drives(rig: TwoComputers) -> bool:
    since_s = driving_since(rig.poses())
    return since_s is not None and _now(rig) - since_s >= DRIVES_S


def _now(rig: TwoComputers) -> float:
    return rig.poses()[-1].stamp_s
