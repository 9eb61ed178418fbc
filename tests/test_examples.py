"""The small examples run, each without ROS and as it says, and show one thing on a page."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
FILES = sorted(EXAMPLES.glob("e[0-9][0-9]_*.py"))
PRINTS = re.compile(r'\A""".*?\n\nIt prints:\n\n(.*?)"""\n', re.DOTALL)
NEEDED = {"e06_odds": "stormpy", "e05_counterexample": "z3"}
"""What an example needs besides the library."""


def test_there_are_twelve_and_each_has_a_line_in_the_readme() -> None:
    assert len(FILES) == 12
    assert [int(path.name[1:3]) for path in FILES] == list(range(1, 13))
    readme = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"\[(e\d\d_\w+\.py)\]\(\1\)", readme) == [path.name for path in FILES]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_prints_what_it_says(path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if path.stem in NEEDED:
        pytest.importorskip(NEEDED[path.stem])
    monkeypatch.chdir(tmp_path)  # it finds its own files wherever it is started
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    text = path.read_text(encoding="utf-8")
    assert 20 <= len(text.splitlines()) <= 60
    said = PRINTS.match(text)
    assert said is not None
    runpy.run_path(str(path), run_name="__main__")
    shown = capsys.readouterr().out
    assert "".join(f"    {line}".rstrip() + "\n" for line in shown.splitlines()) == said[1]
    assert list(tmp_path.iterdir()) == []
