"""A replay with one thing changed: the tree decides again over what was recorded, and the first difference is reported.

It prints:

    as it was: None
    with force_n 3:
      decisions differ at 2.21 s: input force
        then: start arm.place (force=5) at 2.21 s   [three parts > next part > place]
        now:  start arm.place (force=3) at 2.21 s
    with a camera that dies, over mocks from there on: degraded
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alula import Mission, open_run

ARM = Path(__file__).parent / "arm"

with tempfile.TemporaryDirectory() as folder:
    Mission.load("sort", ARM).run(seed=1, out=Path(folder) / "run")
    run = open_run(Path(folder) / "run", ARM)
    print("as it was:", run.replay().difference)
    softer = run.replay(settings={"force_n": 3.0})
    print("with force_n 3:", *(softer.difference.lines(zero_s=0.0) if softer.difference else ()), sep="\n  ")
    blind = run.replay(fail=["camera@3.5"], go_on=True)
    print("with a camera that dies, over mocks from there on:", blind.end.outcome.value if blind.end else "not over")
