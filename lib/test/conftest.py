"""Makes the helpers of all rooms' tests importable (pytest's importlib mode does not)."""

import sys
from pathlib import Path

sys.path.extend(str(room) for room in sorted(Path(__file__).parent.iterdir()) if room.is_dir())
