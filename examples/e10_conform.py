"""Conformance: the events of a run held against a model; each has to be one that the model's semantics allows.

It prints:

    its own model: True, 30 events
    another model: at 2.2 s hand BUSY -> FULL (pick 000000000002 hold): no step that the model allows in this situation has it
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alula import Mission, open_run

ARM = Path(__file__).parent / "arm"

with tempfile.TemporaryDirectory() as folder:
    Mission.load("sort", ARM).run(seed=1, out=Path(folder) / "run")
    run = open_run(Path(folder) / "run", ARM)
    verdict = run.conform()
    print(f"its own model: {verdict.conforms}, {verdict.events} events")
    other = Path(folder) / "other.skill"
    text = (ARM / "skillsets/arm.skill").read_text(encoding="utf-8")
    other.write_text(text.replace("success PICKED: apply = hold", "success PICKED: apply = open"), encoding="utf-8")
    (finding,) = run.conform(other).findings
    print(f"another model: at {finding.stamp_s:.1f} s {finding.event}: {finding.why}")
