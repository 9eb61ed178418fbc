"""The small examples run as they say, twelve without ROS and four with it, and show one thing on a page each."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from alula.common.network import claim_domain

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
FILES = sorted(EXAMPLES.glob("e[0-9][0-9]_*.py"))
WITH_ROS = sorted(EXAMPLES.glob("r[0-9][0-9]_*.py"))
PRINTS = re.compile(r'\A""".*?\n\nIt prints:\n\n(.*?)"""\n', re.DOTALL)
WHOLE_RUN = "r16_run"
NEEDED = {"e06_odds": "stormpy", "e05_counterexample": "z3"}
"""What an example needs besides the library."""


def test_there_are_sixteen_and_each_has_a_line_in_the_readme() -> None:
    assert (len(FILES), len(WITH_ROS)) == (12, 4)
    assert [int(path.name[1:3]) for path in (*FILES, *WITH_ROS)] == list(range(1, 17))
    readme = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"\[([er]\d\d_\w+\.py)\]\(\1\)", readme) == [path.name for path in (*FILES, *WITH_ROS)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_prints_what_it_says(path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if path.stem in NEEDED:
        pytest.importorskip(NEEDED[path.stem])
    monkeypatch.chdir(tmp_path)  # it finds its own files wherever it is started
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    expected = said_by(path)
    runpy.run_path(str(path), run_name="__main__")
    assert indented(capsys.readouterr().out) == expected
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [pytest.param(path, marks=pytest.mark.flight if path.stem == WHOLE_RUN else ()) for path in WITH_ROS],
                         ids=lambda path: path.stem)  # fmt: skip
def test_with_ros_it_prints_what_it_says(path: Path, tmp_path: Path) -> None:
    claim = claim_domain()
    try:
        done = subprocess.run(
            [sys.executable, str(path)],
            cwd=tmp_path,
            env={**os.environ, "ROS_DOMAIN_ID": str(claim.domain)},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        claim.release()
    assert done.returncode == 0, done.stderr[-4000:]
    assert indented(done.stdout) == said_by(path)


def said_by(path: Path) -> str:
    """Return what an example says that it prints."""
    text = path.read_text(encoding="utf-8")
    assert 20 <= len(text.splitlines()) <= 60
    said = PRINTS.match(text)
    assert said is not None
    return said[1]


def indented(text: str) -> str:
    return "".join(f"    {line}".rstrip() + "\n" for line in text.splitlines())
