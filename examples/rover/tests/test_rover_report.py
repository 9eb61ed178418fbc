"""The rover's part of the report, of a drive over mocks."""

from __future__ import annotations

import json
from pathlib import Path

from alula.cli import run

ROOT = Path(__file__).resolve().parents[1]


def test_a_parcel_that_was_not_delivered_is_told_with_what_failed(monkeypatch, tmp_path):
    monkeypatch.setenv("ALULA_ROBOT", str(ROOT))
    shut = "skills: {cargo.open_door: [{when: door == 'workshop', result: SHUT}]}"
    (tmp_path / "shut.yaml").write_text(shut, encoding="utf-8")
    words = ["deliver", "--mock", "--behaviour", str(tmp_path / "shut.yaml"), "--out", str(tmp_path / "run")]
    assert run.main(words) == 0
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert summary["problems"] == []
    assert [(one["name"], one["done"]) for one in summary["tasks"]] == [
        ("store-kitchen", True),
        ("kitchen-workshop", False),
        ("workshop-office", False),
    ]
    assert [one["why"].partition(":")[0] for one in summary["tasks"]] == ["", "open_door SHUT", "open_door SHUT"]
