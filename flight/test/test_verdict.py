"""The last lines of a flight."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula_flight.verdict import verdict_lines

LATER = {"detected_s": 40.5, "fallback_running_s": None, "moving_again_s": None}
MOCK = {"wall_s": 1.0, "factor": 100.0, "notes": []}


@pytest.mark.parametrize(
    ("injected", "video", "told"),
    [
        ([{"sensor": "radio", "mode": "critical", "t_s": 40.0}], None, "radio failed at 40.00 s"),
        ([{"sensor": "zed", "mode": "dead", "t_s": 40.1}], {"freezes": 1}, "zed failed at 40.00 s"),
        ([{"sensor": "zed", "mode": "dead", "t_s": 12.0}], {"freezes": 1}, "radio lost at 40.00 s"),
        ([], None, "sensor failed at 40.00 s"),
    ],
)
def test_what_failed_is_named(injected, video, told, tmp_path: Path):
    summary = {"outcome": "degraded", "mock": MOCK, "video": video, "injected": injected, "recovery": {"failure_s": 40.0, **LATER}}
    lines = verdict_lines(summary, [], tmp_path)
    assert f"  recovery: {told}, detected 0.50 s later" in lines
