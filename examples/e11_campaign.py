"""A campaign: many runs with other seeds and faults, counted; `alula campaign` does it with a report of each.

It prints:

    accomplished: 123
    degraded: 77
    slowest: 25.3 s
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from alula import Mission, Outcome

RUNS = 200

mission = Mission.load("sort", Path(__file__).parent / "arm")
outcomes: Counter[Outcome] = Counter()
slowest = 0.0
for seed in range(RUNS):
    fault = [f"camera@{seed % 20}"] if seed % 4 == 0 else []
    run = mission.run(*fault, seed=seed)
    assert not run.open_executions, seed
    outcomes[run.outcome] += 1
    slowest = max(slowest, run.world.now_s)
for outcome, number in outcomes.most_common():
    print(f"{outcome.value}: {number}")
print(f"slowest: {slowest:.1f} s")
