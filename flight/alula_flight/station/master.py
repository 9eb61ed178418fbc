"""The ROS 1 master of a deployment, from outside: does it answer, and how far is the clock of its computer from ours?

It answers over HTTP, and each answer says the time of its computer (``Date``), in whole seconds. It is asked until the second changes: at
that moment the time is known to the length of one call. Nothing has to be installed there.
"""

from __future__ import annotations

import email.utils
import http.client
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy, Transport, dumps

MASTER_S = 3.0  # wall clock, for the ROS master to answer
FAR_S = 0.05
"""A clock that is further away is said."""
ASK_FOR_S, ROUGHLY_S, CLOSELY_S, WITHIN_S = 1.5, 0.02, 0.001, 2.0
CALL = dumps(("/alula_clock",), "getPid").encode()
LOOK_S, CLOCK_S = 2.0, 60.0  # wall clock: how often the master is looked at, and its computer's clock


class _Impatient(Transport):
    """Gives up a silent peer: a computer that is off answers nothing at all."""

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = MASTER_S
        return connection


def why_no_master(uri: str) -> str:
    """Return why a ROS master can't be talked to; empty where it answers."""
    try:
        ServerProxy(uri, transport=_Impatient()).getPid("/alula")
    except TimeoutError:
        return f"nothing answers within {MASTER_S:g} s"
    except socket.gaierror:
        return "the name of its computer is not known here"
    except OSError as error:
        return error.strerror or str(error)
    except (XmlRpcError, ExpatError, http.client.HTTPException, ValueError):  # as a web server answers, or a file of its own
        return "another program than a ROS master has that port"
    return ""


@dataclass(frozen=True)
class Offset:
    """The other clock is ahead of ours by ``ahead_s``, which is known to ``within_s``."""

    ahead_s: float
    within_s: float


def offset_of(
    second: Callable[[], int],
    clock: Callable[[], float] = time.time,  # noqa: TID251 - it compares wall clocks
    pause: Callable[[float], None] = time.sleep,
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


def offset_to(master: str) -> Offset | None:
    """Return the offset of the clock of the master's computer; None where it was too slow. Raises OSError where it tells no time."""
    parts = urlsplit(master)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port or 80, timeout=WITHIN_S)

    def second() -> int:
        connection.request("POST", "/RPC2", CALL, {"Content-Type": "text/xml", "Connection": "keep-alive"})
        answer = connection.getresponse()
        answer.read()
        said = answer.getheader("Date")
        return int(email.utils.parsedate_to_datetime(said or "").timestamp())

    try:
        return offset_of(second)
    except (http.client.HTTPException, ValueError, TypeError) as error:
        raise OSError(f"it does not tell its time: {error}") from error
    finally:
        connection.close()


class MasterWatch:
    """Looks at the master in a thread of its own: ``problem`` is why it can't be talked to, ``offset`` that of its computer's clock."""

    def __init__(self, uri: str) -> None:
        self.uri = uri
        self.problem = ""
        self.offset: Offset | None = None
        self._over = threading.Event()
        threading.Thread(target=self._run, name="master", daemon=True).start()

    def close(self) -> None:
        """End it."""
        self._over.set()

    def told(self) -> dict[str, object]:
        """Return what is known, as JSON has it."""
        offset = self.offset
        seconds = {} if offset is None else {"ahead_s": round(offset.ahead_s, 3), "within_s": round(offset.within_s, 3)}
        return {"uri": self.uri, "problem": self.problem, **seconds}

    def _run(self) -> None:
        due_s = 0.0
        while not self._over.is_set():
            self.problem = why_no_master(self.uri)
            if not self.problem and time.monotonic() >= due_s:
                due_s = time.monotonic() + CLOCK_S
                try:
                    self.offset = offset_to(self.uri)
                except OSError:
                    self.offset = None
            self._over.wait(LOOK_S)
