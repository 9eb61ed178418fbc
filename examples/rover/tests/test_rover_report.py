"""The rover's part of the report, of a drive over mocks."""

from __future__ import annotations

from pathlib import Path

from alula import Mission, Outcome, open_run

ROOT = Path(__file__).resolve().parents[1]


def test_a_parcel_that_was_not_delivered_is_told_with_what_failed(tmp_path):
    shut = tmp_path / "shut.yaml"
    shut.write_text("skills: {cargo.open_door: [{when: door == 'workshop', result: SHUT}]}", encoding="utf-8")
    mission = Mission.load("deliver", ROOT, behaviour=[shut]).run(out=tmp_path / "run")
    assert mission.outcome is Outcome.DEGRADED
    summary = open_run(tmp_path / "run", ROOT).report()
    assert summary["problems"] == []
    assert [(one["name"], one["done"]) for one in summary["tasks"]] == [
        ("store-kitchen", True),
        ("kitchen-workshop", False),
        ("workshop-office", False),
    ]
    assert [one["why"].partition(":")[0] for one in summary["tasks"]] == ["", "open_door SHUT", "open_door SHUT"]
