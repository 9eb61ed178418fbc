"""The record of a run's decisions, ``skills.mcap``: messages of JSON on named topics, in the order in which they came.

The file is an MCAP without chunks (https://mcap.dev/spec): each message is on the disk when ``write`` returns, so a crash loses none,
and a reader can follow the file while it grows. Foxglove opens it. Stamps are nanoseconds of mission clock. The order of the file is
the order in which the mission came to know: an event is stamped with when it happened, which may be before what stands above it.
"""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from alula.common.errors import AlulaError
from alula.common.files import strict

FILE = "skills.mcap"

MISSION = "/mission"
"""What was asked for and how it ended: ``{scenario, outcome, reason, start_s, lift_off_s, end_s, parameters, inputs, problems}`` and what
the plan tells; once at the start, once at the end."""
EVENTS = "/events"
"""Each event of each skillset, as ``alula.runtime.core.events`` writes it down."""
DECISIONS = "/decisions"
"""Each request of the tree: ``{number, kind, skillset, skill, id, inputs}``; kind is start, interrupt, pause, resume or transition."""
TREE = "/tree"
"""The whole tree, whenever a node changed: a nested view; the last one is how it ended."""
BLACKBOARD = "/blackboard"
"""Values of the mission's blackboard that changed, by name."""
TICKS = "/ticks"
"""Each tick of the tree, before what it decides: ``{unmet}``, what keeps the mission from starting; empty once it has started.

Before that also ``conditions``, all that it needs: ``[[needed, what is so instead or ""], ...]``.
"""
REPORTS = "/reports"
"""What the tree was told of its executions: ``{skillset, skill, id, state, progress, result, message, outputs}``, at each change."""
OPERATOR = "/operator"
"""What the operator did: ``{command, by}`` and what belongs to it.

By "mission": what it was told (abort, pause, resume), and what holds since (paused).
"""
DATA = "/data"
"""Samples of data that a skillset got: ``{skillset, data, value, stamp_s}``; each where the model's conditions ask for the data, else
one a second."""

MAGIC = b"\x89MCAP0\r\n"
MAX_RECORD_BYTES = 1 << 28
_HEAD = struct.Struct("<BQ")
_DATA_END = 0x0F
_FOOTER = _HEAD.pack(0x02, 20) + bytes(20) + MAGIC
"""Ends a record that is read by itself: the reader stops here."""


class RecordError(AlulaError):
    """A file is no record; the message names it and says why."""


@dataclass(frozen=True)
class Entry:
    """A message of a record; ``stamp_ns`` is mission clock."""

    topic: str
    stamp_ns: int
    value: Mapping[str, Any]

    @property
    def stamp_s(self) -> float:
        """Stamp in seconds of mission clock."""
        return self.stamp_ns / 1e9


class RecordWriter:
    """Writes a record. A disk that is full ends the record, not the flight: ``error`` says so from then on."""

    def __init__(self, path: Path) -> None:
        self.error = ""
        self._path = path
        self._channels: dict[str, int] = {}
        self._file: BinaryIO = path.open("wb")
        self._writer = Writer(self._file, compression=CompressionType.NONE, use_chunking=False, index_types=IndexType.NONE)
        self._guarded(lambda: self._writer.start(profile="", library="alula"))

    def write(self, topic: str, stamp_ns: int, value: Mapping[str, object]) -> None:
        """Add a message; what JSON does not have (NaN, infinities) becomes null."""
        data = json.dumps(strict(value), allow_nan=False).encode()

        def add() -> None:
            channel = self._channels.get(topic)
            if channel is None:
                channel = self._channels[topic] = self._register(topic)
            self._writer.add_message(channel, log_time=stamp_ns, publish_time=stamp_ns, data=data)

        self._guarded(add)

    def close(self) -> None:
        """End the file as other readers expect it to end."""
        self._guarded(self._writer.finish)
        with contextlib.suppress(OSError):  # what a full disk has not taken is lost, and told in ``error``
            self._file.close()

    def _register(self, topic: str) -> int:
        schema = self._writer.register_schema(f"alula{topic.replace('/', '.')}", "jsonschema", b'{"type": "object"}')
        return int(self._writer.register_channel(topic, "json", schema))

    def _guarded(self, act: Callable[[], None]) -> None:
        if self.error or self._file.closed:
            return
        try:
            act()
            self._file.flush()
        except OSError as error:
            self.error = f"{self._path.name} ends early: {error.strerror or error}"


class RecordFollower:
    """Reads a record, while it grows or afterwards. What is cut off or damaged at its end is left out: ``poll`` returns what is whole."""

    def __init__(self, path: Path) -> None:
        self.ended = False
        """Whether the end that ``RecordWriter.close`` writes was seen."""
        self.broken = ""
        """Why nothing more will be read, where the file is damaged."""
        self._path = path
        self._offset = 0
        self._channels: dict[int, Channel] = {}

    def poll(self, limit: int | None = None) -> list[Entry]:
        """Return the entries that came since the last call; none while there is no file.

        ``limit``: stop behind the record with which there are so many; the next call goes on there.

        Raises:
            RecordError: the file is no MCAP.
        """
        if self.broken or self.ended or not self._path.is_file():
            return []
        with self._path.open("rb") as file:
            if self._offset == 0 and not self._begin(file):
                return []
            file.seek(self._offset)
            entries: list[Entry] = []
            for record in self._records(file):
                entries += self._entries(record)
                if limit is not None and len(entries) >= limit:
                    break
            return entries

    def _begin(self, file: BinaryIO) -> bool:
        magic = file.read(len(MAGIC))
        if magic != MAGIC[: len(magic)]:
            raise RecordError(f"{self._path}: is no MCAP file")
        if len(magic) < len(MAGIC):
            return False
        self._offset = len(MAGIC)
        return True

    def _records(self, file: BinaryIO) -> Iterator[bytes]:
        """Yield whole records, head included, and move on behind each."""
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            kind, length = _HEAD.unpack(head)
            if length > MAX_RECORD_BYTES:
                self.broken = f"damaged at byte {self._offset}"
                return
            content = file.read(length)
            if len(content) < length:
                return
            self._offset += _HEAD.size + length
            if kind == _DATA_END:
                self.ended = True
                return
            yield head + content

    def _entries(self, record: bytes) -> Iterator[Entry]:
        """Yield what a record holds; one of a chunk holds many."""
        try:
            for part in StreamReader(BytesIO(record + _FOOTER), skip_magic=True).records:
                if isinstance(part, Channel):
                    self._channels[part.id] = part
                elif isinstance(part, Message):
                    yield from self._entry(part)
        except Exception as error:  # noqa: BLE001 - damaged bytes: each decompressor and decoder raises types of its own
            self.broken = f"damaged before byte {self._offset}: {error}"

    def _entry(self, message: Message) -> Iterator[Entry]:
        channel = self._channels[message.channel_id]
        if channel.message_encoding != "json":
            return
        value = json.loads(message.data)
        if isinstance(value, dict):
            yield Entry(channel.topic, message.log_time, value)


def read_record(path: Path) -> list[Entry]:
    """Return the entries of a record, up to where it breaks off.

    Args:
        path: the file, or the folder of a run.

    Raises:
        RecordError: there is no such file, or it is no MCAP.
    """
    path = path / FILE if path.is_dir() else path
    if not path.is_file():
        raise RecordError(f"{path}: there is no such record")
    return RecordFollower(path).poll()
