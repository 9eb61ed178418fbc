"""What the tests of all rooms share: helpers that can be imported (pytest's importlib mode does not see to it), and time for proofs."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import SimpleNamespace

from alula.prove import limits

sys.path.extend(sorted({str(module.parent) for module in Path(__file__).parent.glob("*/**/*.py")}))

# Proofs and searches of this process are given processor time instead of wall clock: what they find does not depend on the machine's load.
limits.time = SimpleNamespace(monotonic=time.process_time)  # type: ignore[assignment]
