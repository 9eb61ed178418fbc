"""Lists the bytes of each page that are written by hand, and those that a program has written, largest first.

    setup/in_ros2 python -m manual_site.sizes

Experiments are summed apart: what was tried is not a part of the manual.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from alula.common.generated import MARK

ALULA_ROOT = Path(__file__).resolve().parents[2]
MARKS = MARK, "<!-- Written by"
"""What a program writes stands below one of these."""
APART = "docs/experiments/"
NO_PAGES = ".github/", "CHANGELOG.md"


@dataclass(frozen=True)
class Size:
    """A page's bytes: written by hand, and by a program."""

    name: str
    by_hand: int
    generated: int


def size_of(name: str, text: str) -> Size:
    """Return the size of a page with this text."""
    at = min((place for mark in MARKS if (place := text.find(mark)) >= 0), default=len(text))
    by_hand = len(text[:at].encode())
    return Size(name, by_hand, len(text.encode()) - by_hand)


def sizes() -> list[Size]:
    """Return the sizes of all pages of the checkout, largest by hand first."""
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ALULA_ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    found = [size_of(name, (ALULA_ROOT / name).read_text(encoding="utf-8")) for name in listed if not name.startswith(NO_PAGES)]
    return sorted(found, key=lambda size: (-size.by_hand, size.name))


def lines(found: list[Size]) -> Iterator[str]:
    """Yield a line a page, and the sums."""
    yield f"{'by hand':>8} {'generated':>10}  page"
    yield from (f"{size.by_hand:8} {size.generated:10}  {size.name}" for size in found)
    for what, part in (
        ("the manual", [size for size in found if not size.name.startswith(APART)]),
        ("experiments", [size for size in found if size.name.startswith(APART)]),
    ):
        yield f"{sum(size.by_hand for size in part):8} {sum(size.generated for size in part):10}  {what}"


def main() -> int:
    """Print the list; return the exit code."""
    sys.stdout.writelines(f"{line}\n" for line in lines(sizes()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
