"""A mission over mocks: the tree of a file calls the skills of a robot's models, whose functions are scripts.

It prints:

    accomplished in 9.3 s, 3 parts sorted
    pick PICKED, place PLACED, pick PICKED, place PLACED, pick PICKED, place PLACED
"""

from __future__ import annotations

from pathlib import Path

from alula import Mission

ARM = Path(__file__).parent / "arm"

mission = Mission.load("sort", ARM)  # arm/scenarios/sort.yaml names the tree, arm/missions/sort.xml
run = mission.run(seed=1)
print(f"{run.outcome.value} in {run.world.now_s:.1f} s, {run.facts['sorted']:.0f} parts sorted")
print(", ".join(f"{end.skill} {end.result}" for end in run.ended))
