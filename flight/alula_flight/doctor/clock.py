"""How far the clock of the master's computer is from ours."""

from __future__ import annotations

from alula_flight.doctor.findings import CLOCK, Finding, note, ok, problem
from alula_flight.station.master import FAR_S, Offset, offset_to


def look_at_clock(master: str) -> Finding:
    """Return what is to be said of the clock of the master's computer."""
    try:
        offset = offset_to(master)
    except OSError as error:
        return note(CLOCK, f"the offset to the master's computer is not known: {error}")
    if offset is None:
        return note(CLOCK, "the master was too slow to tell the offset of its computer's clock")
    return told(offset)


def told(offset: Offset) -> Finding:
    """Return an offset as a finding: only what is certainly too much is a problem."""
    far = abs(offset.ahead_s)
    words = f"the clock of the master's computer is {far:.3f} s {'ahead of' if offset.ahead_s > 0 else 'behind'} ours"
    known = f"{words} (within {offset.within_s:.3f} s)"
    if far - offset.within_s > FAR_S:
        return problem(CLOCK, known, "have one computer take its time from the other: chrony or systemd-timesyncd with that server")
    return ok(CLOCK, known)
