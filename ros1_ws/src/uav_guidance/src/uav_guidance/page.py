"""Writes the README's table of parameters: ``python -m uav_guidance.page`` in the ROS 1 world."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from perception_core.tunable import ranges
from uav_guidance.settings import GuidanceSettings

PAGE = Path(__file__).resolve().parents[2] / "README.md"
MARK = "<!-- Below this line: written by"


def main() -> int:
    """Write the table anew; return the exit code."""
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


def page(text: str) -> str:
    """Return the page with its table replaced."""
    above, _, _ = text.partition(MARK)
    table = "\n".join(_parameters())
    return f"{above}{MARK} `python -m uav_guidance.page`, from `settings.py`. -->\n\n{table}\n"


def _parameters() -> Iterator[str]:
    yield from ("| parameter | default | from | to | what it is |", "|---|---|---|---|---|")
    settings = GuidanceSettings()
    for name, allowed in ranges(settings).items():
        default = getattr(settings, name)
        if isinstance(default, bool):
            yield f"| `~{name}` | {str(default).lower()} | | | {allowed.doc} |"
        else:
            yield f"| `~{name}` | {default:.3g} | {allowed.low:.3g} | {allowed.high:.3g} | {allowed.doc} |"


if __name__ == "__main__":
    sys.exit(main())
