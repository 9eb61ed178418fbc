"""Makes the helpers of all rooms' tests importable (pytest's importlib mode does not)."""

import sys
from pathlib import Path

sys.path.extend(sorted({str(module.parent) for module in Path(__file__).parent.glob("*/**/*.py")}))
