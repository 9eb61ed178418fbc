"""The log that Groot2 replays, ``*.btlog``: the tree's XML and each node's transitions, as BehaviorTree.CPP 4's FileLogger2 writes them.

The magic words and a version byte; the length of the XML (int32) and the XML; the date (int64, microseconds since 1970); then nine bytes
a transition: microseconds since that date (48 bits), the node's ``_uid`` (uint16), its status (uint8). All little-endian.

The date is the computer's; time from there on is the mission clock, so a flight in virtual time replays at the speed of the robot.
"""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from alula.trees.groot.protocol import Change, ProtocolError, Transition, pack_transitions

SUFFIX = ".btlog"
MAGIC = b"BTCPP4-FileLogger2"
VERSION = 1
_LENGTH = struct.Struct("<i")
_DATE = struct.Struct("<q")


class LogError(Exception):
    """A file is no such log; the message names it and says why."""


class LogWriter:
    """Writes a log while the tree is ticked. A disk that is full ends the log, not the flight: ``error`` says so from then on.

    ``now_us``: mission clock, microseconds, as `take` is told it. What `take` was given survives a crash of the process.
    """

    def __init__(self, path: Path, xml: str, now_us: int) -> None:
        """Raises OSError when the file can't be made."""
        self.error = ""
        self._name = path.name
        self._began_us = now_us
        self._file: BinaryIO = path.open("wb")
        content = xml.encode()
        self._write(MAGIC + bytes([VERSION]) + _LENGTH.pack(len(content)) + content + _DATE.pack(time.time_ns() // 1000))  # noqa: TID251 - a date

    def take(self, changes: Sequence[Change], now_us: int) -> None:
        """Write what has changed in a tick, in the order of the changes."""
        self._write(pack_transitions(changes, now_us - self._began_us))

    def _write(self, data: bytes) -> None:
        if self.error:
            return
        try:
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            self.error = f"{self._name} ends early: {error.strerror or error}"

    def close(self) -> None:
        """Close the file."""
        with contextlib.suppress(OSError):
            self._file.close()


@dataclass(frozen=True)
class Log:
    """What a log holds; ``began_us``: microseconds since 1970."""

    xml: str
    began_us: int
    transitions: tuple[Transition, ...]


def read_log(path: Path) -> Log:
    """Read a log; of one that a crash has ended, what is whole.

    Raises:
        LogError: it can't be read, or is none.
    """
    try:
        data = path.read_bytes()
        head = len(MAGIC) + 1
        if data[:head] != MAGIC + bytes([VERSION]):
            raise LogError(f"{path}: does not begin as a log of BehaviorTree.CPP 4 does ({MAGIC.decode()}, version {VERSION})")
        (length,) = _LENGTH.unpack_from(data, head)
        begin = head + _LENGTH.size
        (began_us,) = _DATE.unpack_from(data, begin + length)
        rest = begin + length + _DATE.size
        whole = len(data) - (len(data) - rest) % Transition.SIZE
        found = tuple(Transition.unpack(data[at : at + Transition.SIZE]) for at in range(rest, whole, Transition.SIZE))
        return Log(data[begin : begin + length].decode(), began_us, found)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from error
    except (struct.error, UnicodeDecodeError):
        raise LogError(f"{path}: ends or breaks off within the tree that it begins with") from None
    except ProtocolError as error:
        raise LogError(f"{path}: {error}") from error
