"""What a mission needs to start, in its own words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from alula.missions.skillset import Client


@dataclass(frozen=True)
class Condition:
    """One thing that has to be so: ``needed`` says it, ``unmet`` says what is so instead, empty when it is as it has to be."""

    needed: str
    unmet: str = ""


def condition(needed: str, *, holds: bool, otherwise: str) -> Condition:
    """Return a condition that holds, or for which something else is so."""
    return Condition(needed, "" if holds else otherwise)


def answers(clients: Mapping[str, Client]) -> list[Condition]:
    """Return that each skillset answers, as conditions."""
    return [
        condition(f"the skillset {name} answers", holds=client.ready, otherwise=f"the skillset {name} can't be called")
        for name, client in clients.items()
    ]
