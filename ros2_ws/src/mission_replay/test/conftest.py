"""What the tests of replays share."""

from __future__ import annotations

import pytest

import mission_replay.__main__


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    """Make no report of a replay in this process: seconds each; those of ``test_mission_replay_report`` are made."""
    monkeypatch.setattr(mission_replay.__main__, "make_report", lambda *_: None)
