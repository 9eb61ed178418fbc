"""What can fail of the rover, in which ways, and when it does. How a fault is written: ``alula.common.faults``."""

from __future__ import annotations

from collections.abc import Sequence

from alula import parts

FAULTS: dict[str, tuple[str, ...]] = {
    "laser": ("dead", "frozen", "covered"),
    "wheels": ("slip", "weak"),
    "bumper": ("stuck",),
    "battery": ("drains",),
    "door": ("store", "workshop", "kitchen", "office", "side"),
    "person": ("stays", "silent"),
    "pose": ("lost",),
}
"""The things, each with its ways to fail; the first one counts where none is named. Of a door it is the one that stays shut."""


class FaultBoard:
    """Says what fails at the moment, and remembers what failed when. Times count from when the rover first left its place."""

    def __init__(self, requests: Sequence[parts.FaultRequest]) -> None:
        self._requests = [(request, request.how or FAULTS[request.what][0]) for request in requests]
        self._now: set[tuple[str, str]] = set()
        self.changes: list[parts.FaultChange] = []

    def step(self, now_s: float, departed_s: float | None) -> set[tuple[str, str]]:
        """Bring the faults up to date; return those that began just now, as (what, how)."""
        since_s = None if departed_s is None else now_s - departed_s + 1e-6
        lasting = {(request.what, how) for request, how in self._requests if request.lasts(since_s)}
        begun = lasting - self._now
        self.changes += [parts.FaultChange(what, how, now_s) for what, how in sorted(begun)]
        self.changes += [parts.FaultChange(what, parts.MENDED, now_s) for what, _ in sorted(self._now - lasting)]
        self._now = lasting
        return begun

    def lasts(self, what: str, how: str) -> bool:
        """Return whether something fails in this way at the moment."""
        return (what, how) in self._now
