"""The record of a run: what is written is read, whole, cut off or damaged."""

from __future__ import annotations

import json
import math
import os
import queue
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from alula.common import record
from alula.common.record import DECISIONS, EVENTS, FILE, MAGIC, Entry, RecordError, RecordFollower, RecordWriter, read_record

ENTRIES = [
    Entry(EVENTS, 1_000_000_000, {"kind": "EXECUTION", "id": "a", "inputs": {"x": 1.5}}),
    Entry(DECISIONS, 1_000_000_000, {"number": 1, "kind": "start"}),
    Entry(EVENTS, 2_500_000_000, {"kind": "TRANSITION", "text": "é"}),
]


def write(path, entries=ENTRIES):
    writer = RecordWriter(path)
    for entry in entries:
        writer.write(entry.topic, entry.stamp_ns, entry.value)
    return writer


def test_a_record_reads_back_and_the_librarys_own_reader_agrees(tmp_path):
    write(tmp_path / FILE).close()
    assert read_record(tmp_path) == ENTRIES
    with (tmp_path / FILE).open("rb") as file:
        theirs = [(channel.topic, message.log_time) for _, channel, message in make_reader(file).iter_messages()]
    assert theirs == [(entry.topic, entry.stamp_ns) for entry in ENTRIES]


def test_nothing_waits_in_a_buffer_and_a_follower_gets_each_entry_once(tmp_path):
    path = tmp_path / FILE
    follower = RecordFollower(path)
    assert follower.poll() == []
    writer = write(path, ENTRIES[:2])
    assert follower.poll() == ENTRIES[:2]
    assert follower.poll() == []
    writer.write(ENTRIES[2].topic, ENTRIES[2].stamp_ns, ENTRIES[2].value)
    assert follower.poll() == ENTRIES[2:]
    assert not follower.ended
    writer.close()
    assert follower.poll() == []
    assert follower.ended
    writer.close()


def test_what_json_does_not_have_becomes_null(tmp_path):
    writer = RecordWriter(tmp_path / FILE)
    writer.write(EVENTS, 0, {"progress": math.nan, "list": [math.inf]})
    writer.close()
    assert read_record(tmp_path)[0].value == {"progress": None, "list": [None]}


@given(st.data())
def test_a_record_cut_off_anywhere_is_read_up_to_there(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("record") / FILE
    write(path).close()
    content = path.read_bytes()
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    found = read_record(path)
    assert found == ENTRIES[: len(found)]


@given(st.data())
def test_a_damaged_record_is_told_by_place_or_read_as_before(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("record") / FILE
    write(path).close()
    content = bytearray(path.read_bytes())
    for place in data.draw(st.sets(st.integers(len(MAGIC), len(content) - 1), min_size=1, max_size=3)):
        content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    follower = RecordFollower(path)
    found = follower.poll()
    assert found == ENTRIES[: len(found)]
    assert found == ENTRIES or " at byte " in follower.cut
    if follower.broken:
        with pytest.raises(RecordError, match="damaged at byte "):
            read_record(path)


def test_a_message_that_is_left_out_is_told(tmp_path):
    path = tmp_path / FILE
    writer = write(path, ENTRIES[:1])
    before = path.stat().st_size
    writer.write(EVENTS, 0, {"left": "out"})
    behind = path.stat().st_size
    writer.write(EVENTS, 1, {"still": "there"})
    content = path.read_bytes()
    path.write_bytes(content[:before] + content[behind:])
    with pytest.raises(RecordError, match=f"damaged at byte {before}: message 3 follows message 1"):
        read_record(path)
    writer.close()


def test_an_older_record_without_chunks_is_read(tmp_path):
    with (tmp_path / FILE).open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start(profile="", library="alula")
        channel = writer.register_channel(EVENTS, "json", schema_id=0)
        for number in range(3):
            writer.add_message(channel, number, json.dumps({"number": number}).encode(), number)
        writer.finish()
    assert [entry.value["number"] for entry in read_record(tmp_path)] == [0, 1, 2]


def test_what_was_written_is_synced_while_the_record_grows_and_at_its_end(tmp_path, monkeypatch):
    synced = queue.SimpleQueue()
    monkeypatch.setattr(record, "SYNC_S", 0.01)
    monkeypatch.setattr(os, "fsync", lambda _: synced.put((tmp_path / FILE).stat().st_size))
    writer = write(tmp_path / FILE, ENTRIES[:1])
    whole = (tmp_path / FILE).stat().st_size
    while synced.get(timeout=60) < whole:
        pass
    writer.close()
    whole = (tmp_path / FILE).stat().st_size
    while synced.get(timeout=60) < whole:
        pass


def test_a_disk_that_fails_to_sync_is_told(tmp_path, monkeypatch):
    def fail(_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    writer = write(tmp_path / FILE)
    writer.close()
    assert writer.error == f"{FILE} ends early: Input/output error"


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
@given(data=st.data())
def test_a_damaged_chunk_of_another_recorder_ends_the_record_and_does_not_raise(tmp_path_factory, compression, data):
    path = tmp_path_factory.mktemp("record") / FILE
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        channel = writer.register_channel(EVENTS, "json", schema_id=0)
        for number in range(50):
            writer.add_message(channel, number, json.dumps({"number": number}).encode(), number)
        writer.finish()
    assert len(RecordFollower(path).poll()) == 50
    content = bytearray(path.read_bytes())
    place = data.draw(st.integers(len(MAGIC), len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    assert len(RecordFollower(path).poll()) <= 50


def test_what_is_no_record_is_refused(tmp_path):
    with pytest.raises(RecordError, match="no such record"):
        read_record(tmp_path)
    (tmp_path / FILE).write_text("#ROSBAG V2.0\n")
    with pytest.raises(RecordError, match="no MCAP"):
        read_record(tmp_path)


def test_a_full_disk_ends_the_record_and_not_the_flight():
    writer = RecordWriter(Path("/dev/full"))
    writer.write(EVENTS, 0, {"kind": "EXECUTION"})
    assert "No space left" in writer.error
    writer.close()
