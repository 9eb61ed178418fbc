"""Hints about names that are not known."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from alula.common.suggestions import with_nearest

ROOT = Path(__file__).resolve().parents[3]
MANY = [f"skill_{number}" for number in range(40)]


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        (["drive", "dock"], "there is no skill drvie; did you mean `drive`?"),
        (["lift"], "there is no skill drvie; there is `lift`"),
        (MANY, "there is no skill drvie"),
        ([], "there is no skill drvie"),
    ],
)
def test_a_message_without_a_hint_ends_where_it_ends(known: list[str], expected: str) -> None:
    assert with_nearest("there is no skill drvie", "drvie", known) == expected


def test_no_message_has_a_hint_behind_it_that_may_be_empty() -> None:
    bare = re.compile(r"; \{nearest\([^{}]*\)\}")
    rooms = ("lib/alula", "flight", "bridge/ros_bridge", "ros2_ws/src", "ros1_ws/src")
    files = [path for room in rooms for path in (ROOT / room).rglob("*.py")]
    assert len(files) > 100
    assert [str(path) for path in files if bare.search(path.read_text(encoding="utf-8"))] == []
