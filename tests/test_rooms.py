"""Every arrow points down: nothing below ``flight/`` imports or starts what is in it."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

ALULA_ROOT = Path(__file__).resolve().parents[1]
ON_TOP = sorted(path.name for path in (ALULA_ROOT / "flight").iterdir() if (path / "__init__.py").is_file())
BELOW = ("bridge", "ros1_ws/src", "ros2_ws/src", "skillsets")


def texts() -> Iterator[tuple[Path, str]]:
    """Yield each text below, but for tests."""
    for room in BELOW:
        for path in sorted((ALULA_ROOT / room).rglob("*")):
            parts = path.relative_to(ALULA_ROOT).parts
            if path.is_file() and not {"test", "__pycache__"} & set(parts):
                with contextlib.suppress(UnicodeDecodeError):
                    yield path, path.read_text(encoding="utf-8")


def test_no_room_below_names_a_package_on_top() -> None:
    """Also not in a string: a command line with ``-m alula_flight`` is an arrow, too."""
    assert "alula_flight" in ON_TOP
    named = re.compile(rf"\b({'|'.join(ON_TOP)})\b")
    found = [f"{path}:{text.count(chr(10), 0, match.start()) + 1}: {match[0]}" for path, text in texts() for match in named.finditer(text)]
    assert not found, "\n".join(found)
