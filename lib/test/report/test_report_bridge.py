"""The bridge's statistics in a run's summary."""

from __future__ import annotations

from pathlib import Path

import pytest

from alula.report.facts import RunFacts
from alula.report.files import Problems
from alula.report.summary import read_bridge


@pytest.mark.parametrize(
    ("robot", "mock", "missing"),
    [("name: rover", False, True), ("name: rover", True, False), ("name: fleet\nrobots: {rover: rover}", False, False)],
)
def test_statistics_are_missed_where_there_was_a_bridge(
    robot: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, mock: bool, missing: bool
) -> None:
    (tmp_path / "rover").mkdir()
    (tmp_path / "rover" / "robot.yaml").write_text("name: rover\n", encoding="utf-8")
    (tmp_path / "robot.yaml").write_text(f"{robot}\n", encoding="utf-8")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    problems = Problems()
    assert read_bridge(RunFacts("meet", 0, tmp_path / "run", (), (), 0, mock=mock), problems) is None
    assert bool(problems.sentences) is missing
