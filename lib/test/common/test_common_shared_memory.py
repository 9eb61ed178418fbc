"""Shared memory of dead participants: what no process holds a lock on."""

from __future__ import annotations

import fcntl
import os

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


def test_a_port_stays_for_others_write_to_it(tmp_path, monkeypatch):
    """Its next reader would make another one of its name, and what these write would reach nobody."""
    monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
    for name in ("fastrtps_port7000", "fastrtps_port7000_el"):
        (tmp_path / name).touch()
    assert sweep_shared_memory(older_than_s=0.0) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fastrtps_port7000", "fastrtps_port7000_el"]
