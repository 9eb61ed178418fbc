"""A record read, as in a notebook: what the tree decided, what the skills did, from the files that a run has left.

It prints:

    topics: /blackboard, /decisions, /events, /mission, /reports, /ticks, /tree
    outcome: degraded; faults: camera at 4.0 s
      0.2 s  start pick {}
      2.2 s  start place {'force': 5.0}
      3.2 s  start pick {}
      4.0 s  start feel {}
    pick  TERMINATED PICKED from 0.2 to 2.2 s
    place TERMINATED PLACED from 2.2 to 3.2 s
    pick  RESOURCE_INVARIANT_VIOLATED still_sees from 3.2 to 4.0 s
    feel  TERMINATED PICKED from 4.0 to 10.0 s
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alula import Mission, open_run

ARM = Path(__file__).parent / "arm"

with tempfile.TemporaryDirectory() as folder:
    Mission.load("sort", ARM).run("camera@4", seed=1, out=Path(folder) / "run")
    run = open_run(Path(folder) / "run", ARM)
    record = run.record
    print("topics:", ", ".join(record.topics))
    print(f"outcome: {run.outcome.value}; faults: {', '.join(f'{one.sensor} at {one.t_s:.1f} s' for one in run.faults)}")
for decision in record.decisions[:4]:
    print(f"{decision.stamp_s:5.1f} s  {decision.value['kind']} {decision.value['skill']} {decision.value['inputs']}")
for one in record.executions[:4]:
    print(f"{one.skill:5} {one.state.value} {one.result} from {one.requested_s:.1f} to {one.ended_s:.1f} s")
