"""What a run's viewers share: its entries so far, as JSON. Each viewer is sent them from where it is; no viewer has a queue."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from alula.common.robots import RobotFolder, meaning
from alula.report.page.entries import FACTS, written
from alula.report.page.following import RunFollower

POLL_S = 0.1
READ_ENTRIES = 1000
"""Read at once; a record of hours comes in pieces, so that viewers see its beginning, and memory holds one piece."""
CHUNK_BYTES = 1 << 19
"""A message ends with the entry that makes it longer than this."""


@dataclass
class Place:
    """Where a viewer is in a feed: entries that it has, and the version of each fact."""

    session: str = ""
    entries: int = 0
    facts: dict[str, int] = field(default_factory=dict)


class Feed:
    """The entries of one run, of a robot (None: the one that the console is about).

    ``session`` names this life of the feed: a viewer that comes with another one begins again.
    """

    def __init__(self, folder: Path, robot: RobotFolder | None = None) -> None:
        self.folder = folder
        self._robot = robot
        self.session = secrets.token_hex(8)
        self.last_s: float | None = None
        """Mission clock of the newest entry; None: none has been received yet."""
        self.changed = asyncio.Event()
        self._follower = RunFollower(folder)
        self._log: list[str] = []
        self._facts: dict[str, tuple[int, str]] = {}

    @property
    def problems(self) -> list[str]:
        """Return what could not be read."""
        return self._follower.problems

    async def follow(self) -> None:
        """Read new entries until cancelled; wake the viewers that wait for ``changed``."""
        while True:
            self.add(await asyncio.to_thread(self.read))
            await asyncio.sleep(0 if self._follower.behind else POLL_S)

    def read(self) -> list[tuple[str, float | None, str]]:
        """Return the entries since the last call: topic, seconds of mission clock, and the entry as JSON."""
        with meaning(self._robot):
            return [(topic, t_s, written((topic, t_s, value))) for topic, t_s, value in self._follower.poll(READ_ENTRIES)]

    def add(self, entries: Iterable[tuple[str, float | None, str]]) -> None:
        """Add entries, and wake the viewers if there were any."""
        came = False
        for topic, t_s, text in entries:
            came = True
            if topic in FACTS:
                self._facts[topic] = (self._facts.get(topic, (0, ""))[0] + 1, text)
            else:
                self._log.append(text)
                if t_s is not None:
                    self.last_s = t_s if self.last_s is None else max(self.last_s, t_s)
        if came:
            self.changed.set()
            self.changed = asyncio.Event()

    def message(self, place: Place) -> str | None:
        """Return the next message for a viewer, and move its place on; None: it has everything."""
        reset = place.session != self.session
        if reset:
            place.session, place.entries, place.facts = self.session, 0, {}
        facts = {topic: fact for topic, fact in self._facts.items() if place.facts.get(topic) != fact[0]}
        entries, size = [text for _, text in facts.values()], 0
        while place.entries < len(self._log) and size < CHUNK_BYTES:
            entries.append(self._log[place.entries])
            size += len(entries[-1])
            place.entries += 1
        if not entries and not reset:
            return None
        place.facts.update({topic: version for topic, (version, _) in facts.items()})
        head = json.dumps({"session": self.session, "reset": reset, "upTo": place.entries, "of": len(self._log)})
        return f'{head[:-1]},"entries":[{",".join(entries)}]}}'


def place_of(asked: Mapping[str, object]) -> Place:
    """Return the place that a viewer reports; a new one where the report is malformed. Facts are sent again."""
    session, entries = asked.get("session"), asked.get("entries")
    if isinstance(session, str) and isinstance(entries, int) and not isinstance(entries, bool) and entries >= 0:
        return Place(session, entries)
    return Place()
