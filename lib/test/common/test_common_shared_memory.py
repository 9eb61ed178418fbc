"""Shared memory of dead participants: what no process holds a lock on."""

from __future__ import annotations

import fcntl
import os
import struct

import pytest

from alula.common import shared_memory
from alula.common.shared_memory import sweep_shared_memory


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


@pytest.mark.parametrize(("abi", "flags_after"), [("port_node_abi5", 6), ("port_node_abi6", 7)])
def test_a_dead_port_is_marked_where_its_layout_is_known(tmp_path, monkeypatch, abi, flags_after):
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    words = (7000, 0, 7000, 2, 1000, 333, 512, 1, 7)  # the number stands at other places, too
    (tmp_path / "fastrtps_port7000").write_bytes(abi.encode().ljust(20, b"\0") + struct.pack("<9I", *words) + bytes(8))
    (tmp_path / "fastrtps_port7000_el").touch()
    sweep_shared_memory(older_than_s=0.0)
    left = (tmp_path / "fastrtps_port7000").read_bytes()
    assert struct.unpack_from("<9I", left, 20) == (*words[:-1], flags_after)


def test_a_port_stays_for_others_write_to_it(tmp_path, monkeypatch):
    """Its next reader would make another one of its name, and what these write would reach nobody."""
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    for name in ("fastrtps_port7000", "fastrtps_port7000_el"):
        (tmp_path / name).touch()
    assert sweep_shared_memory(older_than_s=0.0) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fastrtps_port7000", "fastrtps_port7000_el"]
