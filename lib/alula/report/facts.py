"""The input of a report: what only the supervisor knows of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict


class Death(TypedDict):
    """A process that ended without a request: when, absolute mission clock, None if unknown; when it ran again, None: never."""

    name: str
    when_s: float | None
    how: str
    again_s: float | None


@dataclass(frozen=True)
class RunFacts:
    """One run. ``faults`` as on the command line (``zed@30``); ``mission_exit`` None: the mission did not end by itself.

    ``mock``: flown in virtual time, over mocks or from a record, so there is neither a bag nor a world nor a map, and no bridge.
    ``replay_of``: the run whose decisions were made again. ``seed`` None: not known, of a replay.
    ``recorded``: its functional layer was recorded; a deployment may record nothing, and then it is no problem that there is no bag.
    ``conformance``: what a monitor says of the events; None without one.
    """

    scenario: str
    seed: int | None
    out_dir: Path
    faults: Sequence[str]
    died: Sequence[Death]
    mission_exit: int | None
    mock: bool = False
    replay_of: str = ""
    conformance: Mapping[str, object] | None = None
    recorded: bool = True
