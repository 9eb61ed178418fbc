"""A run's entries inside its report: what the report was made of can be read from it again."""

from __future__ import annotations

import base64
import gzip
import json
import zlib
from collections.abc import Iterable
from pathlib import Path

from alula.report.page.entries import Wire, written

REPORT = "report.html"
_BEGIN, _END = 'id="record">', "</script>"


def embedded(entries: Iterable[Wire]) -> str:
    """Return entries as the report has them: a gzipped array of JSON in base64."""
    text = f"[{','.join(written(entry) for entry in entries)}]"
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode("ascii")


def entries_inside(page: str) -> list[Wire]:
    """Return the entries inside a report's text.

    Raises:
        ValueError: there are none.
    """
    begin = page.find(_BEGIN) + len(_BEGIN)
    if begin < len(_BEGIN):
        raise ValueError("has no entries inside")
    try:
        entries = json.loads(gzip.decompress(base64.b64decode(page[begin : page.index(_END, begin)], validate=True)))
        return [(str(topic), t_s, value) for topic, t_s, value in entries]
    except (EOFError, OSError, zlib.error, TypeError, ValueError) as error:
        raise ValueError(f"its entries can't be read: {error}") from error


def read_report(path: Path) -> list[Wire]:
    """Return the entries inside a report.

    Raises:
        OSError: it can't be read.
        ValueError: it has none.
    """
    return entries_inside(path.read_text(encoding="utf-8"))
