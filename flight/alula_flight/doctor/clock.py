"""How far the clock of the master's computer is from ours, without anything installed there.

The master answers over HTTP, and each answer says the time of its computer (``Date``), in whole seconds. It is asked until the second
changes: at that moment the time is known to the length of one call.
"""

from __future__ import annotations

import email.utils
import http.client
import time
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit
from xmlrpc.client import dumps

from alula_flight.doctor.findings import CLOCK, Finding, note, ok, problem

FAR_S = 0.05
ASK_FOR_S, ROUGHLY_S, CLOSELY_S, WITHIN_S = 1.5, 0.02, 0.001, 2.0
CALL = dumps(("/alula_doctor",), "getPid").encode()


@dataclass(frozen=True)
class Offset:
    """The other clock is ahead of ours by ``ahead_s``, which is known to ``within_s``."""

    ahead_s: float
    within_s: float


def offset_of(
    second: Callable[[], int], clock: Callable[[], float] = time.time, pause: Callable[[float], None] = time.sleep
) -> Offset | None:
    """Return the offset of a clock that tells whole seconds; None where it tells no change.

    ``second`` asks it, which takes a moment. A first change is looked for every now and then, and the next one closely.
    """
    roughly = _change(second, clock, pause, ROUGHLY_S)
    if roughly is None:
        return None
    # Ours when the next second begins there; by then the calls have to follow each other.
    pause(max(0.0, int(clock() + roughly.ahead_s) + 1 - roughly.ahead_s - 2.0 * roughly.within_s - clock()))
    closely = _change(second, clock, pause, CLOSELY_S)
    return min((one for one in (roughly, closely) if one is not None), key=lambda one: one.within_s)


def _change(second: Callable[[], int], clock: Callable[[], float], pause: Callable[[float], None], every_s: float) -> Offset | None:
    begun_s = asked_s = clock()
    before = second()
    while clock() - begun_s < ASK_FOR_S:
        pause(every_s)
        last_s, asked_s = asked_s, clock()
        told, heard_s = second(), clock()
        if told == before + 1:
            # It became that second after we had begun the last call but one, and before this answer came.
            return Offset(told - (last_s + heard_s) / 2.0, (heard_s - last_s) / 2.0)
        before = told
    return None


def look_at_clock(master: str) -> Finding:
    """Return what is to be said of the clock of the master's computer."""
    parts = urlsplit(master)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port or 80, timeout=WITHIN_S)

    def second() -> int:
        connection.request("POST", "/RPC2", CALL, {"Content-Type": "text/xml", "Connection": "keep-alive"})
        answer = connection.getresponse()
        answer.read()
        said = answer.getheader("Date")
        return int(email.utils.parsedate_to_datetime(said or "").timestamp())

    try:
        offset = offset_of(second)
    except (OSError, http.client.HTTPException, ValueError, TypeError) as error:
        return note(CLOCK, f"the master does not tell the time of its computer ({error}): the offset is not known")
    finally:
        connection.close()
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
