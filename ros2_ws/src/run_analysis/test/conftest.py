"""Makes this folder's helpers importable (pytest's importlib mode does not), and the random models of the language's tests."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[2] / "skill_language" / "test"))
