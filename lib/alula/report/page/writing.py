"""Makes the page: one HTML file with its style, its program and, in a report, the run's entries inside. It fetches nothing."""

from __future__ import annotations

import base64
import hashlib
import html
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from alula.common.files import write_text
from alula.report.page.causes import Explanation
from alula.report.page.embedded import REPORT, embedded
from alula.report.page.entries import PICTURE, Wire
from alula.report.page.following import RunFollower

PARTS = Path(__file__).parent / "program"
MAX_PICTURES = 400
"""In a report: 3 MB of it at most."""
PROGRAM = (
    "dom", "fold", "robot", "account", "state", "tree", "timeline", "map", "figures", "pictures", "operator", "manual", "repairs", "main",
)  # fmt: skip
"""Files of the program, in the order in which they need each other."""


def make_page(*, title: str, entries: Iterable[Wire] | None = None) -> str:
    """Return the page: a report of ``entries``, or, without any, the live page that gets them over its server's WebSocket."""
    style = (PARTS / "page.css").read_text(encoding="utf-8")
    program = '"use strict";\n(() => {\n' + "\n".join(_part(name) for name in PROGRAM) + "\n})();\n"
    record = "" if entries is None else embedded(entries)
    connect = "'self'" if entries is None else "'none'"
    policy = (
        f"default-src 'none'; script-src {_hash(program)}; style-src {_hash(style)}; img-src data: blob:; connect-src {connect}; "
        "base-uri 'none'; form-action 'none'"
    )
    skeleton = (PARTS / "page.html").read_text(encoding="utf-8")
    values = {"policy": html.escape(policy), "title": html.escape(title), "style": style, "program": program, "record": record}
    for name, value in values.items():
        skeleton = skeleton.replace(f"<!--{name}-->", value)
    return skeleton


def write_report(folder: Path, more: Iterable[Wire] = (), *, title: str, summary: Mapping[str, object] | None = None) -> Explanation:
    """Write ``report.html`` into a run's folder, from its files and from ``more``, the entries of other recordings (``OF_RECORDINGS``).

    The live page of a run that is over takes the latter from the report, and so says what it says, to the last digit. ``summary`` is the
    run's where it is not written yet. Return what the report says of failures and their causes.

    Raises:
        OSError: it can't be written.
    """
    follower = RunFollower(folder, more, summary)
    entries = few_pictures(follower.poll())
    write_text(folder / REPORT, make_page(title=title, entries=sorted(entries, key=lambda entry: (entry[1] is not None, entry[1] or 0.0))))
    return follower.explanation


def few_pictures(entries: list[Wire]) -> list[Wire]:
    """Return the entries with at most so many pictures, evenly in time, that the report stays a file to send around."""
    step = -(-sum(topic == PICTURE for topic, _, _ in entries) // MAX_PICTURES)
    cameras: Counter[str] = Counter()

    def kept(entry: Wire) -> bool:
        if entry[0] != PICTURE or step <= 1:
            return True
        camera = str(entry[2].get("camera")) if isinstance(entry[2], Mapping) else ""
        cameras[camera] += 1
        return cameras[camera] % step == 1

    return [entry for entry in entries if kept(entry)]


def _part(name: str) -> str:
    return (PARTS / f"{name}.js").read_text(encoding="utf-8")


def _hash(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
    return f"'sha256-{digest}'"
