"""The record of a run's decisions, ``skills.mcap``: messages of JSON on named topics, in the order in which they came.

The file is an MCAP (https://mcap.dev/spec) with a chunk for each message: the chunk has a checksum, messages are numbered through, and
the end has a checksum of all. Damage is told by its place, and never read as if it were what was written. Older records have messages
without chunks and numbers. Foxglove opens both. A message is the operating system's when ``write`` returns: a process that dies loses
none, and a reader can follow the file while it grows. It is on the disk within SYNC_S, and at the end: a computer that loses its power
loses that much at most. Stamps are nanoseconds of mission clock. The order of the file is the order in which the mission came to know:
an event is stamped with when it happened, which may be before what stands above it.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
import struct
import threading
import weakref
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Schema, Statistics
from mcap.stream_reader import StreamReader

from alula.common.errors import AlulaError
from alula.common.files import strict

FILE = "skills.mcap"

MISSION = "/mission"
"""What was asked for and how it ended: ``{scenario, outcome, reason, start_s, lift_off_s, end_s, parameters, inputs, problems}`` and what
the mission adds; once at the start, once at the end."""
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
"""What was reported to the tree of its executions: ``{skillset, skill, id, state, progress, result, message, outputs}``, at each change."""
OPERATOR = "/operator"
"""What the operator did: ``{command, by}`` and what belongs to it.

By "mission": what it received (abort, pause, resume), and what holds since (paused).
"""
DATA = "/data"
"""Samples of data that a skillset got: ``{skillset, data, value, stamp_s}``; each where the model's conditions ask for the data, else
one a second."""

MAGIC = b"\x89MCAP0\r\n"
MAX_RECORD_BYTES = 1 << 28
SYNC_S = 1.0
"""Wall clock: what was written is on the disk no later than this, and the time that this takes the disk."""
_LIBRARY = "alula"
_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
"""A chunk's first and last stamp, size, checksum and the length of the name of its compression."""
_LENGTH = struct.Struct("<Q")
_KINDS = frozenset({Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.DATA_END})
"""All that stands in a record of ours, also a compressed one, before its end."""
_FOOTER = _HEAD.pack(Opcode.FOOTER, 20) + bytes(20) + MAGIC
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
        self._schemas: list[Schema] = []
        self._channels: dict[str, Channel] = {}
        self._counts: dict[int, int] = {}
        self._stamps_ns: tuple[int, int] = (0, 0)
        self._crc = 0
        self._unsynced = False
        self._file: BinaryIO = path.open("wb")
        self._over = threading.Event()
        # A disk may take its time, and a tick of the mission can't wait for it.
        self._syncing = threading.Thread(target=_sync_now_and_then, args=(weakref.ref(self), self._over), name="record sync", daemon=True)
        if stat.S_ISREG(os.fstat(self._file.fileno()).st_mode):
            self._syncing.start()
        self._guarded(lambda: self._put(MAGIC + _packed(Header(profile="", library=_LIBRARY))))

    def write(self, topic: str, stamp_ns: int, value: Mapping[str, object]) -> None:
        """Add a message; what JSON does not have (NaN, infinities) becomes null."""
        data = json.dumps(strict(value), allow_nan=False).encode()
        self._guarded(lambda: self._add(topic, stamp_ns, data))

    def close(self) -> None:
        """End the file as other readers expect it to end, on the disk."""
        self._guarded(self._end)
        self._over.set()
        if self._syncing.is_alive():
            self._syncing.join()
        if not self._file.closed:
            self.sync()
        with contextlib.suppress(OSError):  # what a full disk has not taken is lost, and told in ``error``
            self._file.close()

    def sync(self) -> None:
        """Wait until the disk has what was written."""
        if not self._unsynced:
            return
        self._unsynced = False
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self._fail(error)

    def _add(self, topic: str, stamp_ns: int, data: bytes) -> None:
        known = self._channels.get(topic)
        channel = known or self._register(topic)
        number = sum(self._counts.values()) + 1
        message = Message(channel_id=channel.id, log_time=stamp_ns, data=data, publish_time=stamp_ns, sequence=number)
        content = _packed(*(() if known else (self._schemas[-1], channel)), message)
        self._put(
            _packed(
                Chunk(
                    compression="",
                    data=content,
                    message_start_time=stamp_ns,
                    message_end_time=stamp_ns,
                    uncompressed_crc=zlib.crc32(content),
                    uncompressed_size=len(content),
                )
            )
        )
        self._counts[channel.id] = self._counts.get(channel.id, 0) + 1
        first, last = self._stamps_ns if number > 1 else (stamp_ns, stamp_ns)
        self._stamps_ns = (min(first, stamp_ns), max(last, stamp_ns))

    def _register(self, topic: str) -> Channel:
        number = len(self._channels) + 1
        name = f"{_LIBRARY}{topic.replace('/', '.')}"
        self._schemas.append(Schema(id=number, name=name, encoding="jsonschema", data=b'{"type": "object"}'))
        channel = Channel(id=number, topic=topic, message_encoding="json", metadata={}, schema_id=number)
        self._channels[topic] = channel
        return channel

    def _end(self) -> None:
        self._put(_packed(DataEnd(data_section_crc=self._crc)))
        begin = self._file.tell()
        count = sum(self._counts.values())
        summary = _packed(
            *self._schemas,
            *self._channels.values(),
            Statistics(
                attachment_count=0,
                channel_count=len(self._channels),
                channel_message_counts=self._counts,
                chunk_count=count,
                message_count=count,
                message_start_time=self._stamps_ns[0],
                message_end_time=self._stamps_ns[1],
                metadata_count=0,
                schema_count=len(self._schemas),
            ),
        )
        # The checksum of a summary includes the footer up to itself.
        footer = _packed(Footer(summary_start=begin, summary_offset_start=0, summary_crc=0))
        crc = zlib.crc32(footer[:-4], zlib.crc32(summary))
        self._put(summary + _packed(Footer(summary_start=begin, summary_offset_start=0, summary_crc=crc)) + MAGIC)

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._file.flush()
        self._crc = zlib.crc32(data, self._crc)
        self._unsynced = True

    def _guarded(self, act: Callable[[], None]) -> None:
        if self.error or self._file.closed:
            return
        try:
            act()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        self.error = self.error or f"{self._path.name} ends early: {error.strerror or error}"


def _packed(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


def _sync_now_and_then(writer: weakref.ref[RecordWriter], over: threading.Event) -> None:
    """Sync until the writer is closed, or has gone without that."""
    while not over.wait(SYNC_S):
        found = writer()
        if found is None:
            return
        found.sync()
        del found


class RecordFollower:
    """Reads a record, while it grows or afterwards. ``poll`` returns what is whole: what is cut off at the end is left out.

    Nothing is read of what is damaged, nor behind it.
    """

    def __init__(self, path: Path) -> None:
        self.ended = False
        """Whether the end that ``RecordWriter.close`` writes was seen."""
        self.broken = ""
        """Why nothing more will be read, where the file is damaged: ``damaged at byte N: REASON``."""
        self._path = path
        self._offset = 0
        self._crc = zlib.crc32(MAGIC)
        self._ours = False
        self._number = 0
        self._channels: dict[int, Channel] = {}

    @property
    def cut(self) -> str:
        """Why the record breaks off as far as it was read, and where; empty where it was ended as records are."""
        return "" if self.ended else self.broken or f"it was cut off at byte {self._offset}"

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
                if not self._take(record, entries) or (limit is not None and len(entries) >= limit):
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
        """Yield whole records, head included."""
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            kind, length = _HEAD.unpack(head)
            if length > MAX_RECORD_BYTES or (self._ours and kind not in _KINDS) or kind == Opcode.FOOTER:
                self._break("there is no such record")
                return
            content = file.read(length)
            if kind == Opcode.CHUNK and not _fits(content, length):
                self._break("the lengths of a chunk contradict each other")
                return
            if len(content) < length:
                return
            if kind == Opcode.DATA_END:
                self._end(content)
                return
            yield head + content

    def _end(self, content: bytes) -> None:
        crc = int.from_bytes(content[:4], "little")
        if crc not in {0, self._crc}:
            self._break("the checksum of what stands before differs")
            return
        self.ended = True

    def _break(self, reason: str) -> None:
        self.broken = f"damaged at byte {self._offset}: {reason}"

    def _take(self, record: bytes, entries: list[Entry]) -> bool:
        """Add what a record holds, one of a chunk holds many, and move on behind it; tell whether it is whole."""
        try:
            for part in StreamReader(BytesIO(record + _FOOTER), skip_magic=True, validate_crcs=True).records:
                if isinstance(part, Header):
                    self._ours = part.library == _LIBRARY
                elif isinstance(part, Channel):
                    self._channels[part.id] = part
                elif isinstance(part, Message):
                    entries += self._entry(part)
        except Exception as error:  # noqa: BLE001 - damaged bytes: each decompressor and decoder raises types of its own
            self._break(str(error) or type(error).__name__)
            return False
        self._offset += len(record)
        self._crc = zlib.crc32(record, self._crc)
        return True

    def _entry(self, message: Message) -> Iterator[Entry]:
        if self._ours and (message.sequence or self._number):
            if message.sequence != self._number + 1:
                raise ValueError(f"message {message.sequence} follows message {self._number}")
            self._number = message.sequence
        channel = self._channels.get(message.channel_id)
        if channel is None:
            raise ValueError(f"a message of channel {message.channel_id}, which is not declared")
        if channel.message_encoding != "json":
            return
        value = json.loads(message.data)
        if isinstance(value, dict):
            yield Entry(channel.topic, message.log_time, value)


def _fits(content: bytes, length: int) -> bool:
    """Return whether the lengths in a chunk agree with that of its record, as far as it was written."""
    if len(content) < _CHUNK_HEAD.size:
        return length >= _CHUNK_HEAD.size + _LENGTH.size
    *_, name = _CHUNK_HEAD.unpack_from(content)
    place = _CHUNK_HEAD.size + name
    if place + _LENGTH.size > len(content):
        return bool(place + _LENGTH.size <= length)
    return bool(place + _LENGTH.size + _LENGTH.unpack_from(content, place)[0] == length)


def read_record(path: Path) -> list[Entry]:
    """Return the entries of a record, up to where it was cut off.

    Args:
        path: the file, or the folder of a run.

    Raises:
        RecordError: there is no such file, it is no MCAP, or it is damaged; then ``RecordFollower`` has what stands before.
    """
    path = path / FILE if path.is_dir() else path
    if not path.is_file():
        raise RecordError(f"{path}: there is no such record")
    follower = RecordFollower(path)
    entries = follower.poll()
    if follower.broken:
        raise RecordError(f"{path}: {follower.broken}")
    return entries
