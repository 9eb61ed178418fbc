"""Spoils logs in every way and counts what the conformance check makes of them."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from alula.model.model import Skillset
from alula.records.conformance import SkillsetMonitor
from alula.runtime.core.events import EngineEvent
from log_mutations.mutations import MUTATIONS, Spoiler
from log_mutations.witness import legal

GoodLogs = Sequence[tuple[Skillset, Sequence[EngineEvent]]]


@dataclass
class Count:
    """Spoiled logs of one kind: those in which an event was found, those that an engine really tells, and those neither."""

    caught: int = 0
    legal: int = 0
    missed: int = 0


def conforms(skillset: Skillset, log: Sequence[EngineEvent]) -> bool:
    """Return whether a log conforms."""
    monitor = SkillsetMonitor(skillset)
    return all(monitor.take(event) is None for event in log)


def count(logs: GoodLogs, each: int, chance: random.Random) -> Mapping[str, Count]:
    """Return the counts by kind, of ``each`` spoiled logs a kind."""
    counts = {}
    for kind, mutate in MUTATIONS.items():
        counts[kind] = found = Count()
        for _ in range(each):
            skillset, log = chance.choice(logs)
            spoiled = mutate(Spoiler(skillset, chance), list(log))
            if not conforms(skillset, spoiled):
                found.caught += 1
            elif legal(skillset, spoiled):
                found.legal += 1
            else:
                found.missed += 1
    return counts


def table(counts: Mapping[str, Count]) -> str:
    """Return the counts as a table of Markdown."""
    rows = [f"| {kind} | {one.caught} | {one.legal} | {one.missed} |" for kind, one in counts.items()]
    every = Count(*(sum(getattr(one, name) for one in counts.values()) for name in ("caught", "legal", "missed")))
    rows.append(f"| **all** | {every.caught} | {every.legal} | {every.missed} |")
    return "\n".join(["| what was done to a log | caught | a legal log | missed |", "|---|---|---|---|", *rows])
