"""Missions one after another while a process of either computer is killed at random, one a minute."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from alula_testing.waits import until
from link_rig.cases import LINK, MISSION_S
from link_rig.computers import LOOK_S, Mission, TwoComputers, two_computers
from link_rig.robots import PATROL
from link_rig.verdicts import Survived, Verdict, judge_kills

EVERY_S = 60.0
"""Wall clock from one to the next."""
CAUSES: Mapping[str, tuple[str, ...]] = {
    "bridge": ("bridge", *LINK),
    "managers": ("managers", *LINK),
    "keeper": (),
    "front": ("front",),
    "supervisor": ("supervisor", "no summary"),
    "mission": ("mission",),
    "alula_base": LINK,
    "navigation": ("navigation", "follow_corridor", "drive_to", "dock"),
    "localization": ("pose", "localization"),
    "health": ("laser", "battery", "scan", "supply"),
    "map_server": (),
}
"""What may be killed, and of which words a true cause names one; not master, simulator and roslaunch: they are the world and its init."""


@dataclass(frozen=True)
class _Killed:
    name: str
    mission: int


def run_kills(minutes: int, seed: int, folder: Path) -> Verdict:
    """Kill one process a minute, for so many minutes, while missions follow each other, and then run one that nothing disturbs."""
    chance, killed, ends = random.Random(seed), list[_Killed](), list[Survived]()  # noqa: S311 - the same seed, the same order
    with two_computers(PATROL, folder) as rig:
        mission, due_s = rig.start_mission(), time.monotonic() + EVERY_S
        while len(killed) < minutes:
            until(lambda m=mission, s=due_s: m.ended or time.monotonic() >= s, "a mission ends", MISSION_S, LOOK_S)  # type: ignore[misc]
            if mission.ended:
                ends.append(_survived(mission, killed, len(ends)))
                mission = _next(rig)
                continue
            due_s += EVERY_S
            if name := _kill_one(rig, mission, chance):
                killed.append(_Killed(name, len(ends)))
                sys.stderr.write(f"link_rig: killed {name}\n")
        for _ in range(2):
            until(lambda m=mission: m.ended, "a mission ends", MISSION_S, LOOK_S)  # type: ignore[misc]
            ends.append(_survived(mission, killed, len(ends)))
            mission = _next(rig)
        until(lambda: mission.ended, "the last mission ends", MISSION_S, LOOK_S)
        return judge_kills(
            f"{minutes} processes killed, one a minute (seed {seed}: {', '.join(one.name for one in killed)})",
            [*ends, Survived(mission.end, ())],
            rig.poses(),
            beats=rig.beats(),
            collisions=rig.collisions,
            silent_after_s=rig.silent_after_s,
        )


def _next(rig: TwoComputers) -> Mission:
    """Start the next mission; a keeper that has died is started before it, which `alula up` does not do under a mission."""
    if "keeper" not in rig.kept():
        rig.up()
    return rig.start_mission()


def _kill_one(rig: TwoComputers, mission: Mission, chance: random.Random) -> str:
    """Kill one of what runs; return what that was, empty where it had ended by itself."""
    running = {**rig.nodes(), **rig.kept(), **mission.processes}
    name = chance.choice([one for one in CAUSES if one in running])
    try:
        psutil.Process(running[name]).kill()
    except psutil.NoSuchProcess:
        return ""
    return name


def _survived(mission: Mission, killed: list[_Killed], number: int) -> Survived:
    """Return how a mission ended; what was killed in the one before may be felt still."""
    words = [word for one in killed if one.mission in {number - 1, number} for word in CAUSES[one.name]]
    return Survived(mission.end, tuple(words))
