"""The log that Groot2 replays: byte by byte, whole and broken off."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from alula.trees.groot.btlog import LogError, LogWriter, read_log
from alula.trees.groot.protocol import Status, Transition


@pytest.fixture
def written(tmp_path) -> Path:
    now_us = 5_000_000
    path = tmp_path / "run.btlog"
    log = LogWriter(path, "<root/>", now_us)
    log.take([(258, Status.IDLE, Status.RUNNING)], now_us)
    log.take([(1, Status.RUNNING, Status.SKIPPED)], now_us + (1 << 32) + 3)
    log.close()
    return path


def test_its_bytes_are_those_of_the_format(written):
    data = written.read_bytes()
    date = data[30:38]
    assert 1.7e15 < struct.unpack("<q", date)[0] < 1e17  # microseconds since 1970
    assert data == (
        b"BTCPP4-FileLogger2" + b"\x01"  # magic words, version
        b"\x07\x00\x00\x00<root/>" + date +  # length of the XML, the XML
        b"\x00\x00\x00\x00\x00\x00" b"\x02\x01" b"\x01"  # after 0 us node 258 is RUNNING
        b"\x03\x00\x00\x00\x01\x00" b"\x01\x00" b"\x04"  # after 2^32 + 3 us node 1 is SKIPPED
    )  # fmt: skip


def test_it_reads_back(written):
    log = read_log(written)
    assert log.xml == "<root/>"
    assert log.transitions == (Transition(0, 258, Status.RUNNING), Transition((1 << 32) + 3, 1, Status.SKIPPED))


def test_what_was_taken_is_there_without_an_end(tmp_path):
    log = LogWriter(tmp_path / "run.btlog", "<root/>", 0)
    assert read_log(tmp_path / "run.btlog").transitions == ()
    log.take([(1, Status.IDLE, Status.RUNNING)], 0)
    assert len(read_log(tmp_path / "run.btlog").transitions) == 1
    log.close()


def test_each_broken_end_reads_or_is_refused_in_a_line(written):
    data = written.read_bytes()
    for length in range(len(data)):
        written.write_bytes(data[:length])
        if length < 38:
            with pytest.raises(LogError, match=r"run\.btlog: (does not begin|ends or breaks off)"):
                read_log(written)
        else:
            assert len(read_log(written).transitions) == (length - 38) // 9


@pytest.mark.parametrize(
    ("at", "byte", "words"),
    [
        (0, 0, "does not begin as a log"),
        (18, 2, "version 1"),
        (22, 0xFF, "breaks off"),
        (23, 0xFF, "breaks off"),
        (46, 9, "there is no status 9"),
    ],
)
def test_bytes_that_are_wrong_are_refused_in_a_line(written, at, byte, words):
    data = bytearray(written.read_bytes())
    data[at] = byte
    written.write_bytes(data)
    with pytest.raises(LogError, match=words) as caught:
        read_log(written)
    assert str(written) in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(LogError, match=r"none\.btlog: No such file"):
        read_log(tmp_path / "none.btlog")


def test_a_full_disk_ends_the_log_and_not_the_flight():
    log = LogWriter(Path("/dev/full"), "<root/>", 0)
    assert log.error == "full ends early: No space left on device"
    log.take([(1, Status.IDLE, Status.RUNNING)], 0)
    log.close()
