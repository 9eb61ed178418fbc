"""Writes the list of pages in docs/index.md from the navigation of the site and the first sentence of each page.

    setup/in_ros2 python -m manual_site.contents

A page is listed where `mkdocs.yml` has it, under its title there, with what its first sentence says: for whom it is.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

from alula.common.files import write_text
from alula.common.generated import replaced

ALULA_ROOT = Path(__file__).resolve().parents[2]
PAGE = ALULA_ROOT / "docs/index.md"
COMMAND = "setup/in_ros2 python -m manual_site.contents"


def main() -> int:
    """Write the list anew; return the exit code."""
    write_text(PAGE, page(PAGE.read_text(encoding="utf-8")))
    return 0


def page(text: str) -> str:
    """Return the page with its list replaced."""
    nav = yaml.safe_load((ALULA_ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    parts = [line for entry in nav for title, inside in entry.items() if isinstance(inside, list) for line in _part(title, inside)]
    return replaced(text, COMMAND, "mkdocs.yml and the pages' first sentences", parts[1:])


def _part(title: str, entries: list[dict[str, object]]) -> Iterator[str]:
    """Yield the lines of a part: a table, and one more for each part inside of it."""
    yield from ("", f"## {title}", "", "| page | for |", "|---|---|")
    for entry in entries:
        for name, inside in entry.items():
            if isinstance(inside, str):
                yield _row(name, inside)
            elif isinstance(inside, list):
                yield f"| **{name}** | |"
                yield from (_row(below, str(path)) for one in inside for below, path in one.items())


def _row(title: str, path: str) -> str:
    file = ALULA_ROOT / "docs" / path if (ALULA_ROOT / "docs" / path).is_file() else ALULA_ROOT / path
    return f"| [{title}]({os.path.relpath(file, PAGE.parent)}) | {audience(file.read_text(encoding='utf-8'))} |"


def audience(text: str) -> str:
    """Return for whom a page is, of its first sentence, without links; empty where it does not begin with "For"."""
    paragraph = " ".join(text.split("\n\n", 2)[1].split())
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)
    sentence = re.split(r"(?<=[.?])\s(?=[A-Z`])|\.$", plain)[0]
    return sentence.removeprefix("For ").removesuffix(".") if sentence.startswith("For ") else ""


if __name__ == "__main__":
    sys.exit(main())
