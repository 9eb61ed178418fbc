"""Odds: how likely the mission is accomplished, by the figures in arm/skillsets/faults.yaml; not sampled, computed (it needs stormpy).

It prints:

    as it is: accomplished 0.697, degraded 0.303
    a camera that never fails: accomplished 0.729, degraded 0.271
    time to the end, on average: 11.1 s 11.1 s
"""

from __future__ import annotations

from pathlib import Path

from alula import Mission

mission = Mission.load("sort", Path(__file__).parent / "arm")
for title, change in (("as it is", ""), ("a camera that never fails", "camera=never")):
    odds = mission.odds(change)
    accomplished, degraded = odds.outcomes["accomplished"], odds.outcomes["degraded"]
    print(f"{title}: accomplished {accomplished.least.value:.3f}, degraded {degraded.least.value:.3f}")
least, most = mission.odds().seconds
print("time to the end, on average:", *(f"{bound.value:.1f} s" for bound in (least, most) if bound is not None))
