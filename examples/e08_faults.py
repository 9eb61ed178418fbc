"""Faults: the same mission, while the camera dies at different times; times count from the start here.

It prints:

    none         accomplished  9.3 s  pick PICKED, pick PICKED, pick PICKED
    camera       degraded     21.3 s  pick sees, feel PICKED, pick sees, feel PICKED, pick sees, feel PICKED
    camera@3.5   degraded     17.6 s  pick PICKED, pick still_sees, feel PICKED, pick sees, feel PICKED
    camera@3.5-6 degraded     13.6 s  pick PICKED, pick still_sees, feel PICKED, pick PICKED
"""

from __future__ import annotations

from pathlib import Path

from alula import Mission

mission = Mission.load("sort", Path(__file__).parent / "arm")
for faults in ([], ["camera"], ["camera@3.5"], ["camera@3.5-6"]):
    run = mission.run(*faults, seed=1)
    ended = [f"{one.skill} {one.result}" for one in run.ended if one.skill != "place"]
    print(f"{' '.join(faults) or 'none':12} {run.outcome.value:12} {run.world.now_s:4.1f} s  {', '.join(ended)}")
