"""The mission's live tests fly over the same faked functional layer as the skills' own."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "uav_skills" / "test"))
