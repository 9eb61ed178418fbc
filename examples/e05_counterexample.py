"""A counterexample: without its invariant `pick` could go on blindly, and the proof shows how, step by step.

It prints:

    as it is: 0 errors
    ALU531: property `never_blind` (never) does not hold: hand == BUSY, camera == BROKEN, pick running
      1. initially hand == EMPTY, camera == WORKING
      2. pick starts: hand EMPTY -> BUSY
      3. the functional layer: camera WORKING -> BROKEN
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from alula import Severity, check_files

MODEL = Path(__file__).parent / "arm/skillsets/arm.skill"
INVARIANT = "still_sees: resource = (camera == WORKING) violation = open"

print("as it is:", sum(one.severity is Severity.ERROR for one in check_files(MODEL)), "errors")
with tempfile.TemporaryDirectory() as folder:
    blind = Path(folder) / "blind.skill"
    blind.write_text(MODEL.read_text(encoding="utf-8").replace(INVARIANT, ""), encoding="utf-8")
    (error,) = [one for one in check_files(blind) if one.severity is Severity.ERROR]
print(f"{error.code}: {error.message}")
for number, step in enumerate(error.counterexample.steps, 1):
    print(f"  {number}. {step.text}")
