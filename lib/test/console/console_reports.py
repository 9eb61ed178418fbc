"""Reports of runs, as a page that a browser opens."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from console_records import LIFT_OFF_S, Story, failing_story, write_record

from alula.report.page.embedded import REPORT
from alula.report.page.entries import Wire
from alula.report.page.writing import write_report

OTHER_RECORDINGS = ("/fault", "/path")
"""Topics of the page that the record of the mission does not hold."""
SUMMARY = {
    "outcome": "degraded", "reason": "the ZED broke", "landed": True, "duration_s": 60.0, "distance_m": 60.0, "collisions": 0,
    "recovery": {"failure_s": 29.9, "detected_s": 30.0, "fallback_running_s": 30.5, "moving_again_s": 34.0},
    "lift_off": {"stamp_s": LIFT_OFF_S, "source": "simulator"}, "problems": [],
    "died": [{"name": "zed_depth", "when_s": 29.8, "how": "signal 11"}],
}  # fmt: skip


def make_report(folder: Path, story: Story | None = None, *, world: str = "yard.yaml", recordings: Sequence[Wire] = ()) -> str:
    write_record(folder, failing_story() if story is None else story)
    (folder / "summary.json").write_text(json.dumps(SUMMARY), encoding="utf-8")
    (folder / "run.json").write_text(json.dumps({"scenario": "mapping", "seed": 1, "faults": ["zed@30"], "world": world}), encoding="utf-8")
    fault = ("/fault", LIFT_OFF_S + 29.9, {"sensor": "zed", "mode": "dead"})
    health = ("/health", LIFT_OFF_S + 30.0, {"sensor": "zed", "ok": False, "fault": "silent", "reason": "no image for 0.4 s"})
    write_report(folder, [fault, health, *recordings], title="mapping")
    return f"file://{folder / REPORT}"


def make_story_report(folder: Path, story: Story, summary: dict[str, Any]) -> str:
    """Write the report of a story: the record, and what other recordings tell."""
    told = [entry for entry in story if entry[1] in OTHER_RECORDINGS]
    write_record(folder, [entry for entry in story if entry[1] not in OTHER_RECORDINGS])
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    (folder / "run.json").write_text(json.dumps({"scenario": "inspection", "seed": 1, "world": ""}), encoding="utf-8")
    write_report(folder, [(topic, t_s, value) for t_s, topic, value in told], title="inspection")
    return f"file://{folder / REPORT}"
