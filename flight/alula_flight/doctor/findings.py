"""What an examination finds, each with its remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """How bad it is."""

    OK = "ok"
    NOTE = "note"  # may be as it is meant
    PROBLEM = "problem"


@dataclass(frozen=True)
class Finding:
    """Something that was looked at.

    Attributes:
        area: what it belongs to, one of `AREAS`.
        level: how bad it is.
        what: in a sentence.
        remedy: what to do; empty where nothing has to be done.
    """

    area: str
    level: Level
    what: str
    remedy: str = ""


PARTS, NAMES, MASTER, NODES, BINDINGS, ROS2, CLOCK, DISK = AREAS = (
    *("parts", "names", "ROS 1 master", "ROS 1 nodes"),
    *("bindings", "ROS 2", "clock", "disk"),
)
"""In the order in which one looks: what an earlier one finds explains what the later ones do."""


def ok(area: str, what: str) -> Finding:
    """Return a finding of what is right."""
    return Finding(area, Level.OK, what)


def note(area: str, what: str, remedy: str = "") -> Finding:
    """Return a finding of what may be meant."""
    return Finding(area, Level.NOTE, what, remedy)


def problem(area: str, what: str, remedy: str) -> Finding:
    """Return a finding of what has to be mended."""
    return Finding(area, Level.PROBLEM, what, remedy)


def any_problem(findings: Iterable[Finding]) -> bool:
    """Return whether one of them has to be mended."""
    return any(one.level is Level.PROBLEM for one in findings)


def lines_of(findings: Iterable[Finding]) -> Iterator[str]:
    """Yield them for people, by area."""
    area = ""
    for one in findings:
        if one.area != area:
            area = one.area
            yield area
        yield f"  {one.level.value:<8} {one.what}"
        if one.remedy:
            yield f"           to mend it: {one.remedy}"


def listed(names: Iterable[str], most: int = 4) -> str:
    """Return names for a sentence, the first of many."""
    every = sorted(names)
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more
