"""Shared memory of dead participants: what no process holds a lock on."""

from __future__ import annotations

import fcntl
import os
import struct

import pytest

from alula.common import shared_memory
from alula.common.shared_memory import fail_dead_ports, sweep_shared_memory


def test_only_what_is_provably_dead_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    for name in ("fastrtps_dead", "fastrtps_dead_el", "fastrtps_alive", "fastrtps_alive_el", "fastrtps_new_el", "other_el"):
        (tmp_path / name).touch()
    for name in ("fastrtps_dead_el", "fastrtps_alive_el"):
        os.utime(tmp_path / name, (0, 0))
    with (tmp_path / "fastrtps_alive_el").open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert sweep_shared_memory() == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fastrtps_alive", "fastrtps_alive_el", "fastrtps_new_el", "other_el"]
    assert sweep_shared_memory(older_than_s=0.0) == 2


def test_a_port_stays_for_others_write_to_it(tmp_path, monkeypatch):
    """Its next reader would make another one of its name, and what these write would reach nobody."""
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    for name in ("fastrtps_port7000", "fastrtps_port7000_el"):
        (tmp_path / name).touch()
    assert sweep_shared_memory(older_than_s=0.0) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fastrtps_port7000", "fastrtps_port7000_el"]


def port(number, *, well=True, check_ms=1000, layout=b"port_node_abi5\0"):
    """Return a port as Fast DDS 2.14.5 lays it out: its node at 276, the name of the layout behind the cells."""
    node = struct.pack("<6IB", number, 0, check_ms, 333, 512, 1, 0b110 | well)
    return bytes(276) + node + bytes(1000) + layout


def test_a_port_whose_reader_died_is_marked_so_that_its_writers_open_it_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    for number in (7413, 7415, 7417):
        (tmp_path / f"fastrtps_port{number}").write_bytes(port(number, well=number != 7417))
        (tmp_path / f"fastrtps_port{number}_el").touch()
    (tmp_path / "fastrtps_port7419").write_bytes(port(7419))  # nobody has read from it yet
    with (tmp_path / "fastrtps_port7415_el").open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert fail_dead_ports() == 1
        assert fail_dead_ports() == 0
    for number, well in ((7413, False), (7415, True), (7417, False), (7419, True)):
        assert (tmp_path / f"fastrtps_port{number}").read_bytes() == port(number, well=well), number
    sweep_shared_memory()
    assert (tmp_path / "fastrtps_port7415").read_bytes() == port(7415, well=False)


@pytest.mark.parametrize(
    "other", [b"", bytes(3), port(7413)[:290], port(7414), port(7413, check_ms=900), port(7413, layout=b"port_node_abi9\0"), 2 * port(7413)]
)
def test_a_port_that_is_laid_out_otherwise_is_left_as_it_is(tmp_path, monkeypatch, other):
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    (tmp_path / "fastrtps_port7413").write_bytes(other)
    (tmp_path / "fastrtps_port7413_el").touch()
    assert fail_dead_ports() == 0
    assert (tmp_path / "fastrtps_port7413").read_bytes() == other


@pytest.mark.parametrize("told", ["", "1: FLOCK  ADVISORY  WRITE 7 00:1b:1 0 EOF\n\n", None])
def test_a_port_of_another_pid_namespace_whose_lock_is_not_listed_stays_well(tmp_path, monkeypatch, told):
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    monkeypatch.setattr(shared_memory, "LOCKS", tmp_path / "locks")
    if told is not None:
        (tmp_path / "locks").write_text(told)
    (tmp_path / "fastrtps_port7413").write_bytes(port(7413))
    with (tmp_path / "fastrtps_port7413_el").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert fail_dead_ports() == 0
    assert fail_dead_ports() == 1
