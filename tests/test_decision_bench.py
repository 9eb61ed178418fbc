"""A decision side that does not come up: the bench says so, and leaves what its parts have said."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import pytest

from decision_bench import __main__ as bench


def test_what_the_parts_said_is_left_where_the_skillsets_can_not_be_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def measure(_processes: object, _seconds: float, folder: Path) -> bench.Figures:
        folder.mkdir()
        (folder / "managers.log").write_text("why", encoding="utf-8")
        raise bench.UnreadyError(f"can't be called; see {folder}")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(bench, "measure", measure)
    assert bench.main(["--processes", "single", "--seconds", "1"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    told = re.fullmatch("alula bench decision: can't be called; see (.*)\n", said.err)
    assert told is not None
    assert (Path(told[1]) / "managers.log").read_text(encoding="utf-8") == "why"


def test_nothing_is_left_of_what_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def measure(_processes: object, _seconds: float, folder: Path) -> bench.Figures:
        folder.mkdir()
        return bench.Figures(3.0, 1.0, {"bridge": bench.Usage(1, 100.0, 70.0, 0.01)})

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(bench, "measure", measure)
    assert bench.main(["--processes", "single", "--seconds", "1"]) == 0
    assert "| single | bridge | 1 | 100 | 70 | 0.010 |" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_of_a_measurement_that_was_broken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(_processes: object, _seconds: float, folder: Path) -> bench.Figures:
        folder.mkdir()
        raise KeyboardInterrupt

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(bench, "measure", measure)
    with pytest.raises(KeyboardInterrupt):
        bench.main(["--processes", "single", "--seconds", "1"])
    assert list(tmp_path.iterdir()) == []
