"""What a mission needs to start, in its own words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Condition:
    """One thing that has to be so: ``needed`` says it, ``unmet`` says what is so instead, empty when it is as it has to be."""

    needed: str
    unmet: str = ""


def condition(needed: str, *, holds: bool, otherwise: str) -> Condition:
    """Return a condition that holds, or for which something else is so."""
    return Condition(needed, "" if holds else otherwise)
